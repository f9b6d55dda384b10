"""The goal that a user sets for a character that has learned a task."""

import math

import torch
from torch import Tensor

from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.tasks.goals import GoalTask, unit
from murmillo.viewer.pilots import WORLD

DIRECTION, FACING, SPEED, TARGET = "direction_w", "facing_w", "speed", "target_w"
"""The goals of `murmillo.envs.tasks` that a user can set, by their names there."""


class Goals:
    """What the user asks of the task, in place of the goals that it draws.

    Attributes:
        settable: the goals of this task that can be set.
        chosen: what has been set so far, by name.
    """

    def __init__(self, env: HumanoidVectorEnv, generator: torch.Generator) -> None:
        """`generator` draws goals anew when the user asks for it."""
        task = env.task
        self._task = task if isinstance(task, GoalTask) else None
        known = (DIRECTION, FACING, SPEED, TARGET)
        self.settable = tuple(name for name in known if self._task and name in self._task.goal_shapes)
        self.chosen: dict[str, Tensor] = {}
        self._env, self._generator = env, generator

    def move(self, angle: float) -> None:
        """Move in the direction at this angle from the world's x axis [rad]."""
        self._command(DIRECTION, unit(torch.tensor(angle, dtype=torch.float64)))

    def face(self, angle: float) -> None:
        """Face the direction at this angle from the world's x axis [rad]."""
        self._command(FACING, unit(torch.tensor(angle, dtype=torch.float64)))

    def hasten(self, speed: float) -> None:
        """Move at this speed [m/s]."""
        self._command(SPEED, torch.tensor(speed, dtype=torch.float64))

    def go_to(self, x: float, y: float) -> None:
        """Go to this place on the ground [m], or in its direction where the task has no place to go to.

        A target in the air stays at its height.
        """
        if TARGET in self.settable:
            target = self.now(TARGET)
            target[:2] = torch.tensor([x, y])
            self._command(TARGET, target)
        elif DIRECTION in self.settable:
            root_x, root_y = self._env.state.qpos[0, :2].tolist()
            self.move(math.atan2(y - root_y, x - root_x))

    def now(self, name: str) -> Tensor:
        """A copy of a goal that holds, of the shape that it has in one world."""
        assert self._task is not None
        return self._task.goals[name][0].clone()

    def redraw(self) -> None:
        """Forget what was set; the task draws anew."""
        self.chosen.clear()
        self._env.task.reset(WORLD, self._env.state, self._generator)

    def renew(self) -> None:
        """Set what was chosen in a new episode too."""
        if self._task is not None and self.chosen:
            self._task.command(WORLD, **{name: goal.unsqueeze(0) for name, goal in self.chosen.items()})

    def _command(self, name: str, goal: Tensor) -> None:
        assert self._task is not None
        self.chosen[name] = goal
        self.renew()
