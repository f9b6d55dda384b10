"""A look at whether environment, demonstrations and configuration fit together, before anything is made of them."""

import torch
from gymnasium import spaces
from gymnasium.vector import VectorEnv

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Demonstrations


def dimensions(env: VectorEnv, demonstrations: Demonstrations, window: int) -> tuple[int, int]:
    """Features of the state D and of the action A.

    Args:
        env: read for its spaces.
        demonstrations: of which one is drawn.
        window: W, frames that the agent's discriminator sees.

    Raises:
        AgentError: environment or demonstrations give no windows `[W, D]`, or actions are no vector.
    """
    observations, action_dim = env.single_observation_space, action_size(env)
    if not isinstance(observations, spaces.Dict) or not {"state", "window"} <= observations.keys():
        raise AgentError("the agent needs observations 'state' and 'window'; make the environment with window >= 2")
    state_dim = spaces.flatdim(observations["state"])
    drawn = demonstrations(1, torch.Generator().manual_seed(0))["window"][0]
    expected = [window, state_dim]
    for origin, shape in (("the environment", observations["window"].shape), ("a demonstration", drawn.shape)):
        if list(shape or ()) != expected:
            raise AgentError(f"agent.window={window} wants windows {expected}; {origin} has {list(shape or ())}")
    return state_dim, action_dim


def action_size(env: VectorEnv) -> int:
    """A, the numbers of an action; an AgentError where it is no vector."""
    actions = env.single_action_space
    if not isinstance(actions, spaces.Box) or len(actions.shape) != 1:
        raise AgentError(f"the agent needs a Box action space [A]; the environment's is {actions}")
    return actions.shape[0]


def skill_count(env: VectorEnv) -> int:
    """K, the skills that the environment may command; an AgentError where it commands none."""
    space = env.single_observation_space
    skill = space.spaces.get("skill") if isinstance(space, spaces.Dict) else None
    if not isinstance(skill, spaces.Discrete):
        raise AgentError(f"the agent needs the label as a discrete observation 'skill'; the environment's is {skill}")
    return int(skill.n)
