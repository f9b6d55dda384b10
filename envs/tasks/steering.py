"""Moving in one direction while facing another (ASE eq. 19)."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from murmillo.envs.markers import Marker
from murmillo.envs.physics import State
from murmillo.envs.tasks.arguments import check_choice, check_range, check_steps
from murmillo.envs.tasks.goals import (
    BLUE,
    RED,
    GoalTask,
    directions,
    facing,
    ground_arrow,
    ground_velocity,
    into_heading,
    uniform,
)


@dataclass(frozen=True)
class SteeringConfig:
    """Arguments of `Steering`.

    Attributes:
        speed: least and greatest target speed; None is the paper's 1.5, the published code's 1.5 to 1.6 [m/s].
        hold_steps: directions and a speed hold for a number of control steps between these two [1/30 s].
        form: "paper", or "code": in the published code of ASE the first term also asks for no speed aside, of which it
            has the sum of the world's x and y, and is 0 for one who does not move that way at all; the second is 0 for
            one who faces away.
    """

    speed: tuple[float, float] | None = None
    hold_steps: tuple[int, int] = (100, 200)
    form: Literal["paper", "code"] = "paper"


class Steering(GoalTask):
    """Move in a direction at a speed and face a direction of its own; all change now and then."""

    config_type = SteeringConfig
    goal_shapes: ClassVar[dict[str, tuple[int, ...]]] = {"direction_w": (2,), "speed": (), "facing_w": (2,)}
    goal_dim = 5
    goal_doc = (
        "unit vector of the direction to move (2), target speed [m/s] (1), unit vector of the direction to face (2), "
        "heading frame"
    )
    reward_doc = (
        "0.7 exp(-0.25 (v* - v)²) + 0.3 h*·h, v the root's speed in the direction to move, v* the target speed, "
        "h*·h the cosine of the heading and the direction to face"
    )

    def __init__(self, config: SteeringConfig | None = None) -> None:
        """Raises SuiteError naming the argument that cannot be."""
        config = config or SteeringConfig()
        check_choice("form", config.form, ("paper", "code"))
        published = (1.5, 1.5) if config.form == "paper" else (1.5, 1.6)
        self._speed = published if config.speed is None else config.speed
        check_range("speed", self._speed, least=0.0)
        check_steps("hold_steps", config.hold_steps)
        self.hold_steps, self._form = config.hold_steps, config.form
        self.reward_range = (-0.3 if config.form == "paper" else 0.0, 1.0)

    def draw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> dict[str, Tensor]:
        n = len(env_ids)
        return {
            "direction_w": directions(n, generator),
            "speed": uniform(n, self._speed, generator),
            "facing_w": directions(n, generator),
        }

    def goal(self, state: State) -> Tensor:
        goals = self.goals
        move, face = into_heading(state, torch.stack((goals["direction_w"], goals["facing_w"]), dim=1)).unbind(1)
        return torch.cat((move, goals["speed"].unsqueeze(-1), face), dim=-1).float()

    def reward(self, state: State) -> dict[str, Tensor]:
        direction, velocity_w = self.goals["direction_w"], ground_velocity(state)
        speed = (direction * velocity_w).sum(-1)
        error = (self.goals["speed"] - speed).square()
        cosine = (self.goals["facing_w"] * facing(state)).sum(-1)
        if self._form == "code":
            aside = (velocity_w - speed.unsqueeze(-1) * direction).sum(-1)
            error = torch.where(speed > 0.0, error + 0.1 * aside.square(), torch.inf)
            cosine = cosine.clamp_min(0.0)
        return {"velocity": 0.7 * torch.exp(-0.25 * error).float(), "facing": 0.3 * cosine.float()}

    def markers(self, state: State, world: int) -> list[Marker]:
        size = 0.5 + 0.2 * self.goals["speed"][world].item()
        return [
            ground_arrow(state, world, self.goals["direction_w"][world], size, RED),
            ground_arrow(state, world, self.goals["facing_w"][world], 0.5, BLUE),
        ]
