"""What AdaptNet reads of an environment's observations."""

from dataclasses import dataclass

import torch
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from torch import Tensor

from murmillo.agents.adaptnet.networks import GOAL, LENGTH
from murmillo.agents.common.dimensions import action_size
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.heights import HEIGHTS, check_map
from murmillo.agents.common.interface import Demonstrations, Obs


@dataclass(frozen=True)
class Observed:
    """Sizes of what is observed.

    Attributes:
        frames: F, states at once, oldest first; None where the state is that of one moment `[D]`.
        state_dim: D, features a frame.
        goal_dim: G; 0 without a goal.
        told: names of what policy and critic are told beside the states.
        action_dim: A.
        frame_dim: features of a frame of the discriminators' windows, fewer than those of a state as a rule.
    """

    frames: int | None
    state_dim: int
    goal_dim: int
    told: tuple[str, ...]
    action_dim: int
    frame_dim: int

    @classmethod
    def of(cls, env: VectorEnv, demonstrations: Demonstrations, window: int) -> "Observed":
        """Look at the environment's spaces and at a demonstration.

        Raises:
            AgentError: they do not fit together.
        """
        space = env.single_observation_space
        if not isinstance(space, spaces.Dict) or not {"state", "window"} <= space.keys():
            raise AgentError("the agent needs observations 'state' and 'window'; make the environment with window >= 2")
        shapes = {name: tuple(one.shape or ()) for name, one in space.items()}
        drawn = tuple(demonstrations(1, torch.Generator().manual_seed(0))["window"].shape[1:])
        if shapes["window"] != drawn or drawn[0] != window:
            raise AgentError(
                f"agent.window={window}: the environment's windows are {list(shapes['window'])}, "
                f"the demonstrations' {list(drawn)}; both must be [{window}, features]"
            )
        if len(shapes["state"]) not in (1, 2):
            raise AgentError(f"the agent needs states [D] or [F, D]; the environment's are {list(shapes['state'])}")
        if HEIGHTS in shapes:
            check_map(shapes[HEIGHTS])
        return cls(
            frames=shapes["state"][0] if len(shapes["state"]) == 2 else None,
            state_dim=shapes["state"][-1],
            goal_dim=shapes[GOAL][0] if GOAL in shapes else 0,
            told=tuple(name for name in (LENGTH, GOAL, HEIGHTS) if name in shapes),
            action_dim=action_size(env),
            frame_dim=drawn[1],
        )

    @property
    def needs(self) -> frozenset[str]:
        """The observations that are read again after collection."""
        names = ("state", *self.told)
        return frozenset({*names, *(f"next_{name}" for name in names), "next_window"})

    def state(self, obs: Obs) -> Tensor:
        """States `[..., F, D]`; one moment is a history of one."""
        return obs["state"] if self.frames else obs["state"][..., None, :]

    def beside(self, obs: Obs) -> dict[str, Tensor]:
        """What policy and critic are told beside them."""
        return {name: obs[name] for name in self.told}
