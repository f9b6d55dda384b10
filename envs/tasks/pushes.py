"""Pushes from outside that last for some steps: as a task has them, or again and again whatever the task."""

from dataclasses import dataclass

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.tasks.arguments import are_steps, check_range
from murmillo.envs.tasks.goals import directions, uniform


@dataclass
class PushConfig:
    """Pushes in random level directions, whatever the task (AdaptNet, section 8.4).

    Attributes:
        every: range of the times from the begin of one to that of the next [control steps]; None is no pushes.
        force: range of their forces [N].
        steps: how long one lasts [control steps]; 6 are 0.2 s.
        body: at whose origin.
    """

    every: tuple[int, int] | None = None
    force: tuple[float, float] = (1000.0, 1000.0)
    steps: int = 6
    body: str = "torso"


class Pushes:
    """The push that is under way in each of N worlds, if one is."""

    def __init__(self, num_envs: int) -> None:
        self.left = torch.zeros(num_envs, dtype=torch.int64)
        """[N] control steps for which it goes on."""
        self._force_w = torch.zeros(num_envs, 3, dtype=torch.float64)

    def begin(self, env_ids: Tensor, force: tuple[float, float], steps: int, generator: torch.Generator) -> None:
        """Push the worlds env_ids [n] for some steps, with forces of this range [N] in random level directions."""
        size = uniform(len(env_ids), force, generator).unsqueeze(-1)
        self._force_w[env_ids, :2] = size * directions(len(env_ids), generator)
        self.left[env_ids] = steps

    def pass_step(self) -> None:
        """A control step is over."""
        self.left = (self.left - 1).clamp_min(0)

    def stop(self, env_ids: Tensor) -> None:
        """Push the worlds env_ids [n] no longer."""
        self.left[env_ids] = 0

    @property
    def force_w(self) -> Tensor:
        """[N, 3] forces throughout the coming step, world axes [N]."""
        return torch.where(self.left.unsqueeze(-1) > 0, self._force_w, 0.0)

    def state_dict(self) -> dict[str, Tensor]:
        return {"push_left": self.left.clone(), "force_w": self._force_w.clone()}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        self.left, self._force_w = state["push_left"].clone(), state["force_w"].clone()


class RandomPushes:
    """`PushConfig` in N worlds.

    Attributes:
        body: which of the character's bodies is pushed.
    """

    def __init__(self, character: Character, config: PushConfig, num_envs: int) -> None:
        """Raises SuiteError naming the setting that cannot be."""
        every = config.every or (1, 1)
        if not are_steps(every):
            raise SuiteError(f"pushes.every={every}: needs at least 1 twice, whole numbers with the lower one first")
        if not are_steps((config.steps, config.steps)):
            raise SuiteError(f"pushes.steps={config.steps}: needs at least 1, a whole number")
        check_range("force", config.force, least=0.0, of="pushes.")
        if config.body not in character.bodies:
            raise SuiteError(f"pushes.body={config.body}: no such body; there are: {', '.join(character.bodies)}")
        self.body = character.bodies.index(config.body)
        self._config, self._every = config, every
        self._pushes = Pushes(num_envs)
        self._wait = torch.zeros(num_envs, dtype=torch.int64)

    def reset(self, env_ids: Tensor, generator: torch.Generator) -> None:
        """New episodes in the worlds env_ids [n]."""
        self._pushes.stop(env_ids)
        self._draw_wait(env_ids, generator)

    def advance(self, generator: torch.Generator) -> None:
        """Let a control step pass."""
        self._pushes.pass_step()
        self._wait -= 1
        due = (self._wait <= 0).nonzero().squeeze(-1)
        if len(due):
            self._pushes.begin(due, self._config.force, self._config.steps, generator)
            self._draw_wait(due, generator)

    @property
    def force_w(self) -> Tensor:
        """[N, 3] forces on `body` throughout the coming step, world axes [N]."""
        return self._pushes.force_w

    def state_dict(self) -> dict[str, Tensor]:
        return {"wait": self._wait.clone(), **self._pushes.state_dict()}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        self._wait = state["wait"].clone()
        self._pushes.load_state_dict(state)

    def _draw_wait(self, env_ids: Tensor, generator: torch.Generator) -> None:
        low, high = self._every
        self._wait[env_ids] = torch.randint(low, high + 1, (len(env_ids),), generator=generator)
