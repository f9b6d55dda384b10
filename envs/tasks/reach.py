"""Touching a point in the air with the tip of the sword (ASE eq. 17, CALM eq. 11)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.markers import Marker
from murmillo.envs.physics import State
from murmillo.envs.tasks.arguments import check_choice, check_number, check_range, check_steps
from murmillo.envs.tasks.goals import GoalTask, into_heading, square, uniform
from murmillo.envs.tasks.interface import Task


@dataclass(frozen=True)
class ReachConfig:
    """Arguments of `Reach`.

    Attributes:
        radius: the target lies within this distance of the root, as it is when the target is drawn [m].
        height: least and greatest height of the target above the ground [m].
        scale: of the squared distance in the reward, ASE's 5 or CALM's 4; None takes the form's own [1/m²].
        key_body: the key point that is to be at the target; `sword` is its tip.
        hold_steps: a target holds for a number of control steps between these two [1/30 s].
        form: "paper" draws targets from a ball about the root, heights outside `height` moved to its ends; "code" is
            the published code of ASE: the scale 4, targets in a square of half side `radius` about the world's origin
            at heights drawn from `height`, and an observation that turns the target's place in the world into the
            heading frame but does not subtract the root's.
    """

    radius: float = 1.0
    height: tuple[float, float] = (0.2, 2.0)
    scale: float | None = None
    key_body: str = "sword"
    hold_steps: tuple[int, int] = (50, 100)
    form: Literal["paper", "code"] = "paper"


class Reach(GoalTask):
    """Bring the tip of the sword to a point near the character; it changes now and then."""

    config_type = ReachConfig
    goal_shapes: ClassVar[dict[str, tuple[int, ...]]] = {"target_w": (3,)}
    goal_dim = 3
    goal_doc = "place of the target from the root, x ahead, y to the left, z up [m] (3), heading frame"
    reward_doc = "exp(-scale d²), d the distance of the sword's tip from the target; scale 5 m⁻², 4 m⁻² with form=code"
    quantity_docs: ClassVar[Mapping[str, str]] = {
        **Task.quantity_docs,
        "distance": "of the sword's tip, or what `key_body` names, from the target [m]",
    }

    def __init__(self, config: ReachConfig | None = None) -> None:
        """Raises SuiteError naming the argument that cannot be."""
        self.config = config = config or ReachConfig()
        check_number("radius", config.radius, above=0.0)
        check_range("height", config.height, least=0.0)
        check_steps("hold_steps", config.hold_steps)
        check_choice("form", config.form, ("paper", "code"))
        self._scale = (5.0 if config.form == "paper" else 4.0) if config.scale is None else config.scale
        check_number("scale", self._scale, above=0.0)
        self.hold_steps = config.hold_steps

    def bind(self, num_envs: int, character: Character) -> None:
        super().bind(num_envs, character)
        keys = character.key_bodies
        if self.config.key_body not in keys:
            raise SuiteError(f"task.key_body={self.config.key_body}: no such key point; there are: {', '.join(keys)}")
        self._tip = keys.index(self.config.key_body)

    def draw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> dict[str, Tensor]:
        n, config = len(env_ids), self.config
        if config.form == "code":
            place = square(n, config.radius, generator)
            return {"target_w": torch.cat((place, uniform(n, config.height, generator).unsqueeze(-1)), dim=-1)}
        way = torch.randn(n, 3, generator=generator, dtype=torch.float64)
        distance = config.radius * uniform(n, (0.0, 1.0), generator).pow(1.0 / 3.0)
        target = state.qpos[env_ids, :3] + distance.unsqueeze(-1) * torch.nn.functional.normalize(way, dim=-1)
        target[:, 2].clamp_(*config.height)
        return {"target_w": target}

    def goal(self, state: State) -> Tensor:
        target = self.goals["target_w"]
        return into_heading(state, target if self.config.form == "code" else target - state.qpos[:, :3]).float()

    def reward(self, state: State) -> dict[str, Tensor]:
        return {"position": torch.exp(-self._scale * self._to_target(state).square().sum(-1)).float()}

    def quantities(self, state: State) -> dict[str, Tensor]:
        return super().quantities(state) | {"distance": self._to_target(state).norm(dim=-1)}

    def markers(self, state: State, world: int) -> list[Marker]:
        return [Marker(self.goals["target_w"][world].tolist(), size=0.06)]

    def _to_target(self, state: State) -> Tensor:
        """[N, 3] from what reaches to the target, world axes [m]."""
        return self.goals["target_w"] - state.key_pos_w[:, self._tip]
