"""Following a path on the ground by the skill that is commanded.

C·ASE shows such a path-follower (figure 11) without defining it. This one is directional control (C·ASE eq. 6) towards
a point ahead on the path, whose second term asks for nearness to the path instead of a heading.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from murmillo.envs.devices import Placed
from murmillo.envs.markers import Marker
from murmillo.envs.physics import State
from murmillo.envs.tasks.arguments import check_number, check_numbers, check_points, check_range, check_skill_steps
from murmillo.envs.tasks.goals import BLUE, GoalTask, facing, ground_velocity, into_heading, turned, uniform
from murmillo.envs.tasks.paths import Paths, path_through, random_paths

_SHOWN = 8
"""Balls that show the path ahead, a metre apart."""

_WINDOW = 0.5
"""How far ahead the nearest place is looked for [m]: more than one step of a sprint, less than the way round a bend."""


@dataclass(frozen=True)
class PathFollowConfig:
    """Arguments of `PathFollow`.

    Attributes:
        points: of the path, from the root and in the heading frame as they are when an episode begins [m]; None draws a
            smooth path at random for each episode.
        spline: round the corners of `points` by a spline through them; without, they are joined by straight lines.
        length: of a random path [m]; every path goes straight on after its end.
        bend_radius: least radius of the bends of a random path [m].
        bend_length: of a random path between two draws of its curvature, which changes evenly from one to the next [m].
        lookahead: distances along the path from where the character is to the points that it sees; it is to move
            towards the first [m].
        speed: least and greatest target speed; one holds for an episode [m/s].
        skill_steps: control steps after which another skill is commanded at random; 0 keeps an episode's [1/30 s].
    """

    points: Sequence[tuple[float, float]] | None = None
    spline: bool = True
    length: float = 60.0
    bend_radius: float = 4.0
    bend_length: float = 3.0
    lookahead: tuple[float, ...] = (1.0, 2.0, 4.0)
    speed: tuple[float, float] = (0.5, 5.0)
    skill_steps: int = 5


class PathFollow(GoalTask):
    """Follow a path at a speed by the skill that is commanded. A random path begins at the character, straight ahead.

    How far the character has come, `goals["arc"]`, never falls: it goes on to the nearest place just ahead.
    """

    config_type = PathFollowConfig
    goal_doc = (
        "point on the path from the root, x ahead and y to the left [m] (2 for each of `lookahead`), "
        "target speed [m/s] (1), heading frame"
    )
    reward_doc = (
        "0.7 exp(-0.25 (v* - v)²) + 0.3 exp(-2 e²), v the root's speed towards the first point ahead, v* the target "
        "speed, e the root's distance from the path [m]"
    )

    def __init__(self, config: PathFollowConfig | None = None) -> None:
        """Raises SuiteError naming the argument that cannot be."""
        self.config = config = config or PathFollowConfig()
        for name in ("length", "bend_radius", "bend_length"):
            check_number(name, getattr(config, name), above=0.0)
        check_numbers("lookahead", config.lookahead, above=0.0)
        check_range("speed", config.speed, least=0.0)
        check_skill_steps(config.skill_steps)
        self.skill_steps = int(config.skill_steps)
        self.goal_dim = 2 * len(config.lookahead) + 1
        self._lookahead = Placed(torch.tensor(config.lookahead, dtype=torch.float64))
        self._given: Paths | None = None
        if config.points is not None:
            check_points("points", config.points)
            self._given = path_through(np.array(config.points, dtype=float), config.spline)
        example = self._draw_paths(1, torch.Generator())
        self._spacing = example.spacing
        self.goal_shapes = {"path_w": tuple(example.points.shape[1:]), "arc": (), "speed": ()}

    def draw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> dict[str, Tensor]:
        n = len(env_ids)
        path = self._draw_paths(n, generator).points
        ahead_w = facing(state)[env_ids].unsqueeze(1)
        return {
            "path_w": state.qpos[env_ids, None, :2] + turned(path, ahead_w),
            "arc": torch.zeros(n, dtype=torch.float64),
            "speed": uniform(n, self.config.speed, generator),
        }

    def advance(self, state: State, generator: torch.Generator) -> None:
        super().advance(state, generator)
        self.goals["arc"] = self._nearest(state)[0]

    def goal(self, state: State) -> Tensor:
        points = into_heading(state, self._to_points_ahead(state))
        return torch.cat((points.flatten(1), self.goals["speed"].unsqueeze(-1)), dim=-1).float()

    def reward(self, state: State) -> dict[str, Tensor]:
        direction = torch.nn.functional.normalize(self._to_points_ahead(state)[:, 0], dim=-1)
        speed = (direction * ground_velocity(state)).sum(-1)
        _, distance = self._nearest(state)
        return {
            "velocity": 0.7 * torch.exp(-0.25 * (self.goals["speed"] - speed).square()).float(),
            "on_path": 0.3 * torch.exp(-2.0 * distance.square()).float(),
        }

    def markers(self, state: State, world: int) -> list[Marker]:
        arc = self.goals["arc"] + torch.arange(_SHOWN).unsqueeze(-1)
        shown = self._paths.at(arc.T)[world].tolist()
        target = self._paths.at(arc.T[:, :1] + self._lookahead.like(arc)[:1])[world, 0].tolist()
        return [*(Marker([*place, 0.05], size=0.05, rgba=BLUE) for place in shown), Marker([*target, 0.1], size=0.1)]

    @property
    def _paths(self) -> Paths:
        return Paths(self.goals["path_w"], self._spacing)

    def _draw_paths(self, n: int, generator: torch.Generator) -> Paths:
        """Paths from the origin along x: the one that was given, or random ones."""
        if self._given is not None:
            points = self._given.points.to(generator.device)
            return Paths(points.expand(n, -1, -1), self._given.spacing)
        config = self.config
        return random_paths(n, config.length, config.bend_radius, config.bend_length, generator)

    def _to_points_ahead(self, state: State) -> Tensor:
        """[N, K, 2] from the root to the points ahead that the policy saw last, world axes [m]."""
        arc = self.goals["arc"].unsqueeze(-1) + self._lookahead.like(self.goals["arc"])
        return self._paths.at(arc) - state.qpos[:, None, :2]

    def _nearest(self, state: State) -> tuple[Tensor, Tensor]:
        """How far the characters have come along their paths [N] [m], and how far they are from them [N] [m]."""
        return self._paths.nearest(self.goals["arc"], state.qpos[:, :2], _WINDOW)
