"""Going to a place (ASE eq. 20, CALM eq. 12)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from murmillo.envs.markers import Marker
from murmillo.envs.physics import State
from murmillo.envs.tasks.arguments import check_choice, check_number, check_steps
from murmillo.envs.tasks.goals import (
    TARGET_DOCS,
    GoalTask,
    facing,
    ground_velocity,
    into_heading,
    square,
    towards_target,
)
from murmillo.envs.tasks.interface import Task


@dataclass(frozen=True)
class LocationConfig:
    """Arguments of `Location`.

    Attributes:
        radius: the target lies in the square of this half side about the root, as it is when the target is drawn [m].
        hold_steps: a target holds for a number of control steps between these two [1/30 s].
        form: "paper", or "code" with the terms that the published code of ASE adds.
    """

    radius: float = 10.0
    hold_steps: tuple[int, int] = (100, 200)
    form: Literal["paper", "code"] = "paper"


class Location(GoalTask):
    """Go to a place on the ground and stay there; it changes now and then."""

    config_type = LocationConfig
    goal_shapes: ClassVar[dict[str, tuple[int, ...]]] = {"target_w": (2,)}
    goal_dim = 2
    goal_doc = "place of the target from the root, x ahead and y to the left [m] (2), heading frame"
    reward_doc = (
        "exp(-0.5 d²), d the root's distance from the target on the ground; form=code: 0.5 exp(-0.5 d²) + "
        "0.4 exp(-4 max(0, 1 - v)²) + 0.1 max(0, h·u) with v the speed towards the target (no second term at v ≤ 0), "
        "h·u the cosine of heading and way there; both last terms full where d² < 0.5"
    )
    quantity_docs: ClassVar[Mapping[str, str]] = {**Task.quantity_docs, **TARGET_DOCS}
    place_docs: ClassVar[Mapping[str, str]] = {"target": "where to go"}

    def __init__(self, config: LocationConfig | None = None) -> None:
        """Raises SuiteError naming the argument that cannot be."""
        self.config = config = config or LocationConfig()
        check_number("radius", config.radius, above=0.0)
        check_steps("hold_steps", config.hold_steps)
        check_choice("form", config.form, ("paper", "code"))
        self.hold_steps = config.hold_steps

    def draw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> dict[str, Tensor]:
        return {"target_w": state.qpos[env_ids, :2] + square(len(env_ids), self.config.radius, generator)}

    def goal(self, state: State) -> Tensor:
        return into_heading(state, self.to_target(state)).float()

    def to_target(self, state: State) -> Tensor:
        """[N, 2] from the root to the target, world axes [m]."""
        return self.goals["target_w"] - state.qpos[:, :2]

    def reward(self, state: State) -> dict[str, Tensor]:
        offset = self.to_target(state)
        square_distance = offset.square().sum(-1)
        position = torch.exp(-0.5 * square_distance)
        if self.config.form == "paper":
            return {"position": position.float()}
        way = torch.nn.functional.normalize(offset, dim=-1)
        speed = (way * ground_velocity(state)).sum(-1)
        velocity = torch.where(speed > 0.0, torch.exp(-4.0 * (1.0 - speed).clamp_min(0.0).square()), 0.0)
        face = (way * facing(state)).sum(-1).clamp_min(0.0)
        there = square_distance < 0.5
        return {
            "position": 0.5 * position.float(),
            "velocity": 0.4 * velocity.masked_fill(there, 1.0).float(),
            "facing": 0.1 * face.masked_fill(there, 1.0).float(),
        }

    def quantities(self, state: State) -> dict[str, Tensor]:
        return super().quantities(state) | towards_target(state, self.goals["target_w"])

    def places(self, state: State) -> dict[str, Tensor]:
        return {"target": self.goals["target_w"].clone()}

    def markers(self, state: State, world: int) -> list[Marker]:
        return [Marker([*self.goals["target_w"][world].tolist(), 0.1], size=0.15)]
