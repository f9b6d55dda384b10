"""Moving at a given speed (ASE eq. 18)."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from murmillo.envs.markers import Marker
from murmillo.envs.physics import State
from murmillo.envs.tasks.arguments import check_range, check_steps
from murmillo.envs.tasks.goals import (
    RED,
    GoalTask,
    directions,
    ground_arrow,
    ground_velocity,
    into_heading,
    uniform,
)


@dataclass(frozen=True)
class SpeedConfig:
    """Arguments of `Speed`.

    Attributes:
        speed: least and greatest target speed [m/s].
        hold_steps: a direction and a speed hold for a number of control steps between these two [1/30 s].
    """

    speed: tuple[float, float] = (0.0, 7.0)
    hold_steps: tuple[int, int] = (100, 200)


class Speed(GoalTask):
    """Move in a direction at a speed; both change now and then."""

    config_type = SpeedConfig
    goal_shapes: ClassVar[dict[str, tuple[int, ...]]] = {"direction_w": (2,), "speed": ()}
    goal_dim = 3
    goal_doc = "unit vector of the direction (2), target speed [m/s] (1), heading frame"
    reward_doc = "exp(-0.25 (v* - v)²), v the root's speed in the direction, v* the target speed"

    def __init__(self, config: SpeedConfig | None = None) -> None:
        """Raises SuiteError naming the argument that cannot be."""
        self.config = config = config or SpeedConfig()
        check_range("speed", config.speed, least=0.0)
        check_steps("hold_steps", config.hold_steps)
        self.hold_steps = config.hold_steps

    def draw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> dict[str, Tensor]:
        n = len(env_ids)
        return {"direction_w": directions(n, generator), "speed": uniform(n, self.config.speed, generator)}

    def goal(self, state: State) -> Tensor:
        direction = into_heading(state, self.goals["direction_w"])
        return torch.cat((direction, self.goals["speed"].unsqueeze(-1)), dim=-1).float()

    def reward(self, state: State) -> dict[str, Tensor]:
        speed = (self.goals["direction_w"] * ground_velocity(state)).sum(-1)
        return {"velocity": torch.exp(-0.25 * (self.goals["speed"] - speed).square()).float()}

    def markers(self, state: State, world: int) -> list[Marker]:
        size = 0.5 + 0.2 * self.goals["speed"][world].item()
        return [ground_arrow(state, world, self.goals["direction_w"][world], size, RED)]
