"""What tasks share: goals that hold for a random time, the heading frame, the character's motion over the ground."""

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.markers import Marker
from murmillo.envs.physics import State
from murmillo.envs.rotations import heading
from murmillo.envs.tasks.interface import Task

RED, BLUE = (0.85, 0.2, 0.15, 0.8), (0.15, 0.3, 0.85, 0.8)
"""Colours of markers: where to go, where to face; those of the published code."""


class GoalTask(Task):
    """A task whose goals are drawn for an episode's begin, and anew each time that a random number of steps is over.

    `goals` holds them by name, each [N, ...] float64; `command` directs the character.
    """

    goal_shapes: Mapping[str, tuple[int, ...]]
    """Names of the goals, and the shape of each in one world."""
    hold_steps: Sequence[int] | None = None
    """Least and most control steps for which goals hold, both included; None keeps them for the episode."""

    def draw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> dict[str, Tensor]:
        """New goals of the worlds env_ids [n], each [n, ...] in the order of env_ids."""
        raise NotImplementedError

    def bind(self, num_envs: int, character: Character) -> None:
        super().bind(num_envs, character)
        self.goals = {
            name: torch.zeros(num_envs, *shape, dtype=torch.float64) for name, shape in self.goal_shapes.items()
        }
        self._steps_left = torch.zeros(num_envs, dtype=torch.int64)

    def reset(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        self._redraw(env_ids, state, generator)

    def advance(self, state: State, generator: torch.Generator) -> None:
        if self.hold_steps is None:
            return
        self._steps_left -= 1
        due = (self._steps_left <= 0).nonzero().squeeze(-1)
        if len(due):
            self._redraw(due, state, generator)

    def command(self, env_ids: Tensor, **goals: Tensor) -> None:
        """Give the worlds env_ids [n] goals of a user's, by name and each [n, ...]; all hold until the episode ends.

        Raises:
            SuiteError: the task has no goal of that name, or one of another shape.
        """
        for name, goal in goals.items():
            if name not in self.goals:
                raise SuiteError(f"goal {name}: there is none of that name; there are: {', '.join(self.goals)}")
            shape = (len(env_ids), *self.goal_shapes[name])
            if goal.shape != shape:
                raise SuiteError(f"goal {name} of shape {tuple(goal.shape)}: needs {shape}")
            self.goals[name][env_ids] = goal.double()
        self._steps_left[env_ids] = torch.iinfo(torch.int64).max

    def state_dict(self) -> dict[str, Any]:
        return {"steps_left": self._steps_left.clone(), **{name: goal.clone() for name, goal in self.goals.items()}}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self._steps_left = state["steps_left"].clone()
        self.goals = {name: state[name].clone() for name in self.goals}

    def _redraw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        for name, rows in self.draw(env_ids, state, generator).items():
            self.goals[name][env_ids] = rows
        if self.hold_steps is not None:
            least, most = self.hold_steps
            self._steps_left[env_ids] = torch.randint(int(least), int(most) + 1, env_ids.shape, generator=generator)


def uniform(n: int, bounds: Sequence[float], generator: torch.Generator) -> Tensor:
    """[n] float64, even between two bounds."""
    low, high = bounds
    return low + (high - low) * torch.rand(n, generator=generator, dtype=torch.float64)


def square(n: int, radius: float, generator: torch.Generator) -> Tensor:
    """[n, 2] float64, even over the square from -radius to radius."""
    return radius * (2.0 * torch.rand(n, 2, generator=generator, dtype=torch.float64) - 1.0)


def directions(n: int, generator: torch.Generator) -> Tensor:
    """[n, 2] float64 unit vectors, all ways alike."""
    return unit(uniform(n, (-torch.pi, torch.pi), generator))


def unit(angle: Tensor) -> Tensor:
    """[..., 2] unit vectors at these angles [...] from the x axis [rad]."""
    return torch.stack((torch.cos(angle), torch.sin(angle)), dim=-1)


def facing(state: State) -> Tensor:
    """[N, 2] unit vector of the character's heading, world axes."""
    return unit(heading(state.qpos[:, 3:7]))


def ground_velocity(state: State) -> Tensor:
    """[N, 2] velocity of the root over the ground, world axes [m/s].

    It is the velocity at the end of the step; the published code has the mean over the step.
    """
    return state.qvel[:, :2]


TARGET_DOCS = {
    "distance": "of the root from the target, over the ground [m]",
    "facing": "cosine of the heading and the way to the target, 1 is straight at it",
    "approach": "speed of the root towards the target [m/s]",
}
"""What `towards_target` gives, by name."""


def towards_target(state: State, target_w: Tensor) -> dict[str, Tensor]:
    """How the character stands to a target at target_w [N, 2] on the ground [m]: `TARGET_DOCS`, each [N]."""
    way = target_w - state.qpos[:, :2]
    ahead = torch.nn.functional.normalize(way, dim=-1)
    return {
        "distance": way.norm(dim=-1),
        "facing": (ahead * facing(state)).sum(-1),
        "approach": (ahead * ground_velocity(state)).sum(-1),
    }


def into_heading(state: State, vector_w: Tensor) -> Tensor:
    """The vectors [N, ..., 2 or 3] of world axes in the axes of each character's heading; z stays."""
    ahead = facing(state).reshape(-1, *[1] * (vector_w.ndim - 2), 2)
    cosine, sine = ahead.unbind(-1)
    return turned(vector_w, torch.stack((cosine, -sine), dim=-1))


def turned(vector: Tensor, by: Tensor) -> Tensor:
    """The vectors [..., 2 or 3] turned about z by the angle of the unit vectors [..., 2] from the x axis."""
    (x, y), (c, s) = vector[..., :2].unbind(-1), by.unbind(-1)
    return torch.cat((torch.stack((c * x - s * y, s * x + c * y), dim=-1), vector[..., 2:]), dim=-1)


def ground_arrow(state: State, world: int, direction: Tensor, size: float, rgba: Sequence[float]) -> Marker:
    """An arrow from below the root of this world along direction [2], of world axes."""
    colour = (rgba[0], rgba[1], rgba[2], rgba[3])
    return Marker([*state.qpos[world, :2].tolist(), 0.05], [*direction.tolist(), 0.0], size, colour)
