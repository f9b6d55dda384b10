"""What a task adds to the character: a goal, a reward in named terms, an end. A task knows nothing of agents."""

from typing import Protocol

from torch import Tensor

from murmillo.envs.physics import State


class Task(Protocol):
    """A task over N worlds; every tensor has the worlds first."""

    goal_dim: int
    """Width of `goal`; 0 where a task has none."""

    def reset(self, env_ids: Tensor, state: State) -> None:
        """New goals for the worlds env_ids [n], whose new episodes begin in `state`."""
        ...

    def goal(self, state: State) -> Tensor:
        """[N, goal_dim] the goal as the policy sees it, in the heading frame."""
        ...

    def reward(self, state: State) -> dict[str, Tensor]:
        """Terms by name, each [N]; the environment's reward is their sum."""
        ...

    def terminated(self, state: State) -> Tensor:
        """[N] bool: the episode has come to an end of the task's own."""
        ...
