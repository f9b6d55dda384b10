"""Going from place to place, each in its time (AdaptNet, section 7; the goal is that of its published code)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Literal

import torch
from torch import Tensor

from murmillo.envs.character import CONTROL_DT
from murmillo.envs.markers import Marker
from murmillo.envs.physics import State
from murmillo.envs.rotations import heading
from murmillo.envs.tasks.arguments import check_choice, check_number, check_range, check_steps
from murmillo.envs.tasks.goals import BLUE, TARGET_DOCS, GoalTask, into_heading, towards_target, uniform, unit
from murmillo.envs.tasks.interface import Task

_SEEN_DISTANCE = 3.0
_FARTHEST_SEEN = 1.5
"""The goal shows the distance in units of the first [m], up to the second."""


@dataclass(frozen=True)
class _Gait:
    """Published settings of a gait; `NavigateConfig` says what they are."""

    hold_steps: tuple[int, int]
    speed: float
    deviation: float
    speed_range: tuple[float, float]
    wanted: tuple[float, float]


_GAITS = {
    "walk": _Gait((90, 149), 1.0, 0.25, (0.0, 1.25), (1.2, 1.5)),
    "run": _Gait((60, 89), 1.5, 0.5, (1.0, 3.0), (2.0, 4.0)),
}


@dataclass(frozen=True)
class NavigateConfig:
    """Arguments of `Navigate`.

    Attributes:
        gait: "walk" or "run", whose published settings the next five have where they are None.
        hold_steps: a target holds for a number of control steps between these two [1/30 s]; (90, 149) or (60, 89).
        speed, deviation: of the normal distribution of speeds; at the one drawn, a target is reached just in its time
            [m/s]; 1 and 0.25, or 1.5 and 0.5.
        speed_range: by which that distribution is cut off [m/s]; (0, 1.25) or (1, 3).
        wanted: least and greatest speed that is rewarded on the way [m/s]; (1.2, 1.5) or (2, 4).
        radius: nearer to the target the reward is full [m].
        detour: an episode ends where the target is farther by this than it was when drawn [m].
        turn: a target is drawn to the left or right of the heading by this at most [deg]; 180 is all around.
    """

    gait: Literal["walk", "run"] = "walk"
    hold_steps: tuple[int, int] | None = None
    speed: float | None = None
    deviation: float | None = None
    speed_range: tuple[float, float] | None = None
    wanted: tuple[float, float] | None = None
    radius: float = 0.5
    detour: float = 3.0
    turn: float = 180.0


class Navigate(GoalTask):
    """Go to a place within a time, then to the next one: goal-directed walking or running.

    The policy sees the way that is left and the speed that it takes. The reward is for the velocity of the step, from
    the place where the policy had acted, `goals["from_w"]`.
    """

    config_type = NavigateConfig
    settings: ClassVar[Mapping[str, Any]] = {
        "character": "humanoid",
        "features": "links",
        "window": 5,
        "episode_steps": 500,
        "fall": {"contact": "any", "force": 1.0, "same_body": True, "heights": {}},
        "starts": {"recovery": 0.0, "fallen": 0.0, "reference": 1.0},
    }
    goal_shapes: ClassVar[dict[str, tuple[int, ...]]] = {
        "target_w": (2,),
        "velocity_w": (2,),
        "distance": (),
        "from_w": (2,),
    }
    goal_dim = 4
    goal_doc = (
        "unit vector of the way to the target, x ahead and y to the left (2), speed that it takes to be there in time, "
        "up to the greatest wanted [m/s] (1), distance / 3 m up to 1.5 (1), heading frame"
    )
    reward_doc = (
        "exp(-3 |v - v*|² / |v*|²), v the root's mean velocity over the step, v* towards the target at the speed that "
        "it takes, within `wanted` and no farther than the target; 1 within `radius` of it"
    )
    end_doc = "fall, clock, target farther than when drawn by `detour`"
    quantity_docs: ClassVar[Mapping[str, str]] = {**Task.quantity_docs, **TARGET_DOCS}
    place_docs: ClassVar[Mapping[str, str]] = {"target": "where to go"}
    hold_steps: tuple[int, int]
    speed: float
    deviation: float
    speed_range: tuple[float, float]
    wanted: tuple[float, float]

    def __init__(self, config: NavigateConfig | None = None) -> None:
        """Raises SuiteError naming the argument that cannot be."""
        self.config = config = config or NavigateConfig()
        check_choice("gait", config.gait, tuple(_GAITS))
        published = _GAITS[config.gait]
        for field in fields(published):
            given = getattr(config, field.name)
            setattr(self, field.name, getattr(published, field.name) if given is None else given)
        check_steps("hold_steps", self.hold_steps)
        check_number("speed", self.speed, above=0.0)
        check_number("deviation", self.deviation, above=0.0)
        check_range("speed_range", self.speed_range, least=0.0)
        check_range("wanted", self.wanted, least=0.01)
        check_number("radius", config.radius, least=0.0)
        check_number("detour", config.detour, above=0.0)
        check_number("turn", config.turn, above=0.0, most=180.0)

    def draw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> dict[str, Tensor]:
        n = len(env_ids)
        reach = math.radians(self.config.turn)
        angle = heading(state.qpos[env_ids, 3:7]) + uniform(n, (-reach, reach), generator)
        return {"velocity_w": self._speeds(n, generator).unsqueeze(-1) * unit(angle)}

    def reset(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        super().reset(env_ids, state, generator)
        self.goals["from_w"][env_ids] = state.qpos[env_ids, :2].double()

    def advance(self, state: State, generator: torch.Generator) -> None:
        super().advance(state, generator)
        self.goals["from_w"] = state.qpos[:, :2].clone().double()

    def command(self, env_ids: Tensor, **goals: Tensor) -> None:
        super().command(env_ids, **goals)
        way = self.goals["target_w"][env_ids] - self.goals["from_w"][env_ids]
        self.goals["distance"][env_ids] = way.norm(dim=-1)

    def goal(self, state: State) -> Tensor:
        way = self.goals["target_w"] - state.qpos[:, :2]
        distance = way.norm(dim=-1)
        direction = into_heading(state, torch.nn.functional.normalize(way, dim=-1))
        speed = (distance / self._time(distance)).clamp_max(self.wanted[1])
        seen = (distance / _SEEN_DISTANCE).clamp_max(_FARTHEST_SEEN)
        return torch.cat((direction, torch.stack((speed, seen), dim=-1)), dim=-1).float()

    def reward(self, state: State) -> dict[str, Tensor]:
        target_w, from_w = self.goals["target_w"], self.goals["from_w"]
        way = target_w - from_w
        distance = way.norm(dim=-1)
        fitting = (distance / self._time(distance)).clamp(*self.wanted)
        wanted = torch.minimum(fitting, distance / CONTROL_DT).clamp_min(1e-6)
        velocity_w = (state.qpos[:, :2] - from_w) / CONTROL_DT
        error = velocity_w - wanted.unsqueeze(-1) * torch.nn.functional.normalize(way, dim=-1)
        reward = torch.exp(-3.0 * error.square().sum(-1) / wanted.square())
        near = (target_w - state.qpos[:, :2]).norm(dim=-1) < self.config.radius
        return {"velocity": reward.masked_fill(near, 1.0).float()}

    def terminated(self, state: State) -> Tensor:
        distance = (self.goals["target_w"] - state.qpos[:, :2]).norm(dim=-1)
        return distance - self.goals["distance"] > self.config.detour

    def quantities(self, state: State) -> dict[str, Tensor]:
        return super().quantities(state) | towards_target(state, self.goals["target_w"])

    def places(self, state: State) -> dict[str, Tensor]:
        return {"target": self.goals["target_w"].clone()}

    def markers(self, state: State, world: int) -> list[Marker]:
        target = self.goals["target_w"][world].tolist()
        way = [a - b for a, b in zip(target, state.qpos[world, :2].tolist(), strict=True)]
        pelvis = state.qpos[world, :3].tolist()
        return [Marker([*target, 0.1], size=0.15), Marker(pelvis, [*way, 0.0], 0.5, BLUE)]

    def _redraw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        super()._redraw(env_ids, state, generator)
        way = self.goals["velocity_w"][env_ids] * CONTROL_DT * self._steps_left[env_ids].unsqueeze(-1)
        self.goals["target_w"][env_ids] = state.qpos[env_ids, :2] + way
        self.goals["distance"][env_ids] = way.norm(dim=-1)

    def _time(self, distance: Tensor) -> Tensor:
        """[N] [s] left for the distances [N]; a target of a user's, which holds for good, takes the mean speed."""
        left = self._steps_left * CONTROL_DT
        return torch.where(self._steps_left > self.hold_steps[1], distance.clamp_min(1e-6) / self.speed, left)

    def _speeds(self, n: int, generator: torch.Generator) -> Tensor:
        """[n] [m/s] of the normal distribution cut off at both ends, by its inverse."""
        low, high = (_normal_share((bound - self.speed) / self.deviation) for bound in self.speed_range)
        share = low + (high - low) * torch.rand(n, generator=generator, dtype=torch.float64)
        return (self.speed + self.deviation * torch.special.ndtri(share)).clamp(*self.speed_range)


def _normal_share(x: float) -> float:
    """Share of the standard normal distribution below x."""
    return 0.5 * math.erfc(-x / math.sqrt(2.0))
