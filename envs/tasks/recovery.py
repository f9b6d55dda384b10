"""Recovery: stay up, or get up, under pushes and thrown boxes (ASE, sections 7.3 and 8.4)."""

from dataclasses import dataclass
from typing import Any

import mujoco
import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.markers import Marker
from murmillo.envs.physics import State
from murmillo.envs.scene import add_box, aside
from murmillo.envs.tasks.arguments import check_number, check_range, check_steps
from murmillo.envs.tasks.goals import uniform
from murmillo.envs.tasks.interface import Task
from murmillo.envs.tasks.props import aimed, around, put
from murmillo.envs.tasks.pushes import Pushes

BOXES = {"small_box": (0.2, 1.6), "large_box": (0.5, 12.5)}
"""Edge [m] and mass [kg] of the boxes."""


@dataclass
class RecoveryConfig:
    """Arguments of `Recovery`.

    Attributes:
        force: range of the pushes on the root, in a random level direction [N].
        push_steps: how long a push lasts [control steps]; 15 are 0.5 s.
        every: range of the times from one blow to the next [control steps].
        boxes: share of the blows that are thrown boxes, small or large.
        speed: range of the boxes' speeds [m/s].
        distance: range of the distances that they fly from [m].
        height: of the root that counts as standing [m].
        head_height: of the head that counts as standing [m].
    """

    force: tuple[float, float] = (500.0, 1000.0)
    push_steps: int = 15
    every: tuple[int, int] = (60, 120)
    boxes: float = 0.5
    speed: tuple[float, float] = (30.0, 40.0)
    distance: tuple[float, float] = (4.0, 5.0)
    height: float = 0.5
    head_height: float = 1.0

    def __post_init__(self) -> None:
        for name in ("force", "speed", "distance"):
            check_range(name, getattr(self, name), least=0.0)
        check_steps("every", self.every)
        check_steps("push_steps", (self.push_steps, self.push_steps))
        check_number("boxes", self.boxes, least=0.0)


class Recovery(Task):
    """Blows come at random times: a push on the root for half a second, or a box from four to five metres away.

    A box lies where it has fallen until it is thrown again or the episode ends.

    A fall ends the episode as everywhere; an environment with `fall={"height": 0.0, "heights": {}}` lets it go on, so
    that getting up again can be learned and measured.
    """

    config_type = RecoveryConfig
    reward_doc = "1 where root > 0.5 m and head > 1 m, else 0"

    def __init__(self, config: RecoveryConfig | None = None) -> None:
        self.config = config or RecoveryConfig()

    def edit(self, spec: mujoco.MjSpec) -> None:
        for name, (edge, mass) in BOXES.items():
            add_box(spec, name, (edge, edge, edge), mass, margin=0.1)

    def bind(self, num_envs: int, character: Character) -> None:
        super().bind(num_envs, character)
        self._head = character.bodies.index("head")
        self._torso = character.bodies.index("torso")
        self._steps_left = torch.zeros(num_envs, dtype=torch.int64)
        self._pushes = Pushes(num_envs)
        self._waiting = torch.ones(num_envs, len(BOXES), dtype=torch.bool)
        self._aside_w = torch.tensor([aside(box) for box in range(len(BOXES))], dtype=torch.float64)

    def reset(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        self._pushes.stop(env_ids)
        self._waiting[env_ids] = True
        self._hold(state)
        self._wait(env_ids, generator)

    def advance(self, state: State, generator: torch.Generator) -> None:
        self._hold(state)
        self._steps_left -= 1
        self._pushes.pass_step()
        due = (self._steps_left <= 0).nonzero().squeeze(-1)
        if not len(due):
            return
        thrown = torch.rand(len(due), generator=generator) < self.config.boxes
        self._pushes.begin(due[~thrown], self.config.force, self.config.push_steps, generator)
        self._throw(due[thrown], state, generator)
        self._wait(due, generator)

    def push(self, state: State) -> Tensor | None:
        return self._pushes.force_w

    def reward(self, state: State) -> dict[str, Tensor]:
        config = self.config
        stands = (state.qpos[:, 2] > config.height) & (state.body_pos_w[:, self._head, 2] > config.head_height)
        return {"standing": stands.float()}

    def markers(self, state: State, world: int) -> list[Marker]:
        if self._pushes.left[world] == 0:
            return []
        force = self._pushes.force_w[world]
        size = float(force.norm()) / 1000.0
        return [Marker(state.qpos[world, :3].tolist(), force.tolist(), size)]

    def state_dict(self) -> dict[str, Any]:
        own = {"steps_left": self._steps_left.clone(), "waiting": self._waiting.clone()}
        return {**own, **self._pushes.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self._steps_left, self._waiting = state["steps_left"].clone(), state["waiting"].clone()
        self._pushes.load_state_dict(state)

    def _hold(self, state: State) -> None:
        """Boxes that were not thrown yet hang in the air: lying on the ground they would cost as much as in play."""
        env_ids, box = self._waiting.nonzero(as_tuple=True)
        put(state, env_ids, box, self._aside_w[box])

    def _wait(self, env_ids: Tensor, generator: torch.Generator) -> None:
        low, high = self.config.every
        self._steps_left[env_ids] = torch.randint(low, high + 1, (len(env_ids),), generator=generator)

    def _throw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        """One of the boxes, at the torso and from its height."""
        box = torch.randint(len(BOXES), (len(env_ids),), generator=generator)
        target_w = state.body_pos_w[env_ids, self._torso]
        start_w = target_w.clone()
        start_w[:, :2] = around(target_w, uniform(len(env_ids), self.config.distance, generator), generator)
        put(state, env_ids, box, start_w)
        self._waiting[env_ids, box] = False
        velocity_w = aimed(start_w, target_w, self.config.speed, generator)
        state.prop_qvel[env_ids, box, :3] = velocity_w.to(state.prop_qvel)
