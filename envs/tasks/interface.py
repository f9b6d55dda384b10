"""What a task adds to the character: a goal, a reward in named terms, an end. A task knows nothing of agents."""

from collections.abc import Mapping
from typing import Any, ClassVar

import mujoco
import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.markers import Marker
from murmillo.envs.physics import State


class Task:
    """A task over N worlds, and the base of all: without a goal, a reward, or an end of its own.

    A step of the environment asks, in this order: `reward` and `terminated` for the state that the step has led to,
    with the goals that the policy had seen; then `advance`, which may set new ones; then `reset` for worlds that begin
    anew; then `goal`. Every tensor has the worlds first.
    """

    config_type: ClassVar[type | None] = None
    """Dataclass of the task's arguments, which its constructor takes; None where it has none."""
    settings: ClassVar[Mapping[str, Any]] = {}
    """Settings of `EnvConfig` that the task's id has, where they differ from the defaults."""
    goal_dim: int = 0
    """Width of `goal`; 0 where a task has none."""
    goal_doc: ClassVar[str] = "none"
    """The columns of the goal, their frame and units, for the table of tasks."""
    reward_doc: ClassVar[str] = "0"
    """The reward's formula, for the table of tasks."""
    end_doc: ClassVar[str] = "fall, clock"
    """What ends an episode, for the table of tasks."""
    reward_range: tuple[float, float] = (0.0, 1.0)
    """Least and greatest reward of a step, by which returns are normalised to [0, 1] (ASE, table 1)."""
    skill_steps: int = 0
    """Control steps after which a new skill is commanded at random; 0 keeps an episode's (C.ASE's user-controlled
    policies have 5)."""
    quantity_docs: ClassVar[Mapping[str, str]] = {
        "height": "of the root above the ground [m]",
        "speed": "of the root over the ground [m/s]",
    }
    """What `quantities` gives, by name, with its unit."""
    place_docs: ClassVar[Mapping[str, str]] = {}
    """What `places` gives, by name."""

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Add the task's props to the character's spec (`murmillo.envs.scene.add_box`)."""

    def bind(self, num_envs: int, character: Character) -> None:
        """Make room for the goals of N worlds; called once, before anything else."""
        self.num_envs, self.character = num_envs, character

    def reset(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        """New goals for the worlds env_ids [n], whose new episodes begin in `state`; props are put in place there."""

    def advance(self, state: State, generator: torch.Generator) -> None:
        """Let a control step pass: clocks run, and goals whose time is over are drawn anew."""

    def push(self, state: State) -> Tensor | None:
        """[N, 3] force on the root [N] throughout the coming step, in the world; None is none."""
        return None

    def goal(self, state: State) -> Tensor:
        """[N, goal_dim] the goal as the policy sees it, in the heading frame."""
        return torch.zeros(self.num_envs, self.goal_dim)

    def reward(self, state: State) -> dict[str, Tensor]:
        """Terms by name, each [N]; the environment's reward is their sum."""
        return {"task": torch.zeros(self.num_envs)}

    def terminated(self, state: State) -> Tensor:
        """[N] bool: the episode has come to an end of the task's own."""
        return torch.zeros(self.num_envs, dtype=torch.bool)

    def quantities(self, state: State) -> dict[str, Tensor]:
        """How things stand, in figures that rules can be written in: those of `quantity_docs`, each [N] float64."""
        return {"height": state.qpos[:, 2].clone(), "speed": state.qvel[:, :2].norm(dim=-1)}

    def places(self, state: State) -> dict[str, Tensor]:
        """Where rules can send the character: the points of `place_docs`, each [N, 2] on the ground, world axes [m]."""
        return {}

    def markers(self, state: State, world: int) -> list[Marker]:
        """What a picture of this world shows of its goal."""
        return []

    def state_dict(self) -> dict[str, Any]:
        """Goals and clocks."""
        return {}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`, bit for bit."""
