"""The agents that the commands know: how to configure, make, warm-start and play each."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import torch

from murmillo.agents.ase.agent import ASE
from murmillo.agents.ase.config import ASEConfig
from murmillo.agents.calm.agent import CALM
from murmillo.agents.calm.config import CALMConfig
from murmillo.agents.case.agent import CASE
from murmillo.agents.case.config import CASEConfig
from murmillo.agents.common import checkpoint
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.observations import state_dim


class AgentKind(NamedTuple):
    """An agent by its name in `conf/agent`.

    Attributes:
        config: its configuration.
        make: from environment, demonstrations, configuration and generator; the agent's `random_condition(n)` draws
            what its policy is told, for the warm start.
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
    name: str, config: Any, env: HumanoidVectorEnv, seed: int, ranks: Ranks = ALONE
) -> tuple[Any, torch.Generator]:
    """The agent as it is before training, and the generator that it draws from: equal for equal arguments."""
    generator = torch.Generator(env.device).manual_seed(seed)
    return AGENTS[name].make(env, env.demonstrations, config, generator, ranks=ranks), generator


def checkpoint_meta(name: str, config: Any, env: HumanoidVectorEnv) -> dict[str, Any]:
    """What a checkpoint must share with the environment and the agent that it is loaded into."""
    return {
        "agent": name,
        "character": env.config.character,
        "state_dim": state_dim(env.character),
        "action_dim": _action_dim(env),
        "window": config.window,
        **({"skills": list(env.skills)} if AGENTS[name].labelled else {}),
    }


def _action_dim(env: HumanoidVectorEnv) -> int:
    assert env.single_action_space.shape is not None
    return env.single_action_space.shape[0]


def load_player(name: str, config: Any, env: HumanoidVectorEnv, seed: int, folder: Path) -> Any:
    """The agent of a checkpoint, to play in `env`; its latents and replay are new, as they depend on the worlds.

    Raises:
        AgentError: the checkpoint is damaged, or another character's or agent's.
    """
    agent, _ = make_agent(name, config, env, seed)
    saved = checkpoint.load(folder)
    checkpoint.check_compatible(saved["meta"], checkpoint_meta(name, config, env))
    own = agent.state_dict()
    agent.load_state_dict({**saved["agent"], **{key: own[key] for key in ("latents", "replay") if key in own}})
    return agent
