"""The agents that the commands know: how to configure, make, warm-start and play each."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import torch
from gymnasium import spaces

from murmillo.agents.ase.agent import ASE
from murmillo.agents.ase.config import ASEConfig
from murmillo.agents.calm.agent import CALM
from murmillo.agents.calm.config import CALMConfig
from murmillo.agents.case.agent import CASE
from murmillo.agents.case.config import CASEConfig
from murmillo.agents.common import checkpoint
from murmillo.agents.common.base import Base
from murmillo.agents.common.heights import HEIGHTS
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.envs import HumanoidVectorEnv


class AgentKind(NamedTuple):
    """An agent by its name in `conf/agent`.

    Attributes:
        config: its configuration.
        make: from environment, demonstrations, configuration and generator; the agent's `draw_condition(label)`
            draws what its policy is told of states with labels `[n]`, for the warm start.
        labelled: it is told the skill, so that a checkpoint belongs to one list of skills.
    """

    config: type
    make: Callable[..., Any]
    labelled: bool = False


AGENTS = {
    "ase": AgentKind(ASEConfig, ASE),
    "case": AgentKind(CASEConfig, CASE, labelled=True),
    "calm": AgentKind(CALMConfig, CALM),
}


def make_agent(
    name: str, config: Any, env: HumanoidVectorEnv, seed: int, ranks: Ranks = ALONE, base: Base | None = None
) -> tuple[Any, torch.Generator]:
    """The agent as it is before training, and the generator that it draws from: equal for equal arguments."""
    generator = torch.Generator(env.device).manual_seed(seed)
    return AGENTS[name].make(env, env.demonstrations, config, generator, base, ranks=ranks), generator


def checkpoint_meta(name: str, config: Any, env: HumanoidVectorEnv, *, adapted: bool = False) -> dict[str, Any]:
    """What a checkpoint must share with the environment and the agent that it is loaded into.

    Uneven ground is seen by adaptations alone, and only they ask whether it is shown.
    """
    seen = env.single_observation_space
    assert isinstance(seen, spaces.Dict)
    return {
        "agent": name,
        "character": env.config.character,
        "state_dim": spaces.flatdim(seen["state"]),
        "action_dim": _action_dim(env),
        "window": config.window,
        **({"skills": list(env.skills)} if AGENTS[name].labelled else {}),
        **({"adapted": True, HEIGHTS: HEIGHTS in seen.spaces} if adapted else {}),
    }


def _action_dim(env: HumanoidVectorEnv) -> int:
    assert env.single_action_space.shape is not None
    return env.single_action_space.shape[0]


def load_player(name: str, config: Any, env: HumanoidVectorEnv, seed: int, folder: Path) -> Any:
    """The agent of a checkpoint, to play in `env`; its latents and replay are new, as they depend on the worlds.

    Raises:
        AgentError: the checkpoint is damaged, or another character's or agent's.
    """
    saved = checkpoint.load(folder)
    base = Base.within(saved["agent"])
    checkpoint.check_compatible(saved["meta"], checkpoint_meta(name, config, env, adapted=base is not None))
    agent, _ = make_agent(name, config, env, seed, base=base)
    own = agent.state_dict()
    agent.load_state_dict({**saved["agent"], **{key: own[key] for key in ("latents", "replay") if key in own}})
    return agent


def load_untrained(name: str, config: Any, env: HumanoidVectorEnv, seed: int, folder: Path) -> Any:
    """The agent of a checkpoint as it was before training: of an adaptation, its base, unless the two were merged.

    Raises:
        AgentError: the checkpoint is damaged.
    """
    base = Base.within(checkpoint.load(folder)["agent"])
    return make_agent(name, config, env, seed, base=None if base is None or base.merged else base)[0]
