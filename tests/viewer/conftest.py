"""Sessions with agents that have learned nothing, which is enough to see what they are told."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any

import pytest
import torch

from murmillo.agents.calm.config import CALMConfig, EncoderConfig
from murmillo.agents.common.decoder import SphereDecoder
from murmillo.agents.common.discriminator import DiscriminatorConfig
from murmillo.agents.common.latent_env import LatentEnv
from murmillo.agents.common.ppo import PPOConfig
from murmillo.agents.common.task_agent import TaskAgent, TaskAgentConfig
from murmillo.cli.agents import AGENTS, make_agent
from murmillo.envs import EnvConfig, HumanoidVectorEnv
from murmillo.envs.registration import make_task
from murmillo.viewer.pilots import AgentPilot, PolicyPilot
from murmillo.viewer.session import Session, playable

CONFIG = EnvConfig(window=10, threads=1)
SMALL = {"ppo": PPOConfig(hidden=(8,)), "discriminator": DiscriminatorConfig(hidden=(8,), minibatch=8)}


def small(name: str) -> Any:
    """An agent's configuration with small networks."""
    config = AGENTS[name].config(window=CONFIG.window, **SMALL)
    return dataclasses.replace(config, encoder=EncoderConfig(hidden=(8,))) if isinstance(config, CALMConfig) else config


@lru_cache
def world(task: str) -> HumanoidVectorEnv:
    """One world for all sessions with this task."""
    made = None if task == "Imitation" else make_task(task)
    return HumanoidVectorEnv(1, playable(CONFIG), made)


@pytest.fixture
def play() -> Iterator[Callable[..., Session]]:
    """`play("case")` is a session with an agent; with a task also one with a policy over the agent's latents.

    `play("scratch", "Location")` has a policy that acts itself; with `styles` it is told one of these skills.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)

    def make(name: str = "ase", task: str = "Imitation", seed: int = 1, styles: Sequence[str] = ()) -> Session:
        env = world(task)
        config = TaskAgentConfig(skill=bool(styles), ppo=PPOConfig(hidden=(8,), std=0.1))
        chance = torch.tensor([float(skill in styles) for skill in env.skills]) if styles else None
        if name == "scratch":
            policy = TaskAgent(env, config, torch.Generator().manual_seed(seed))
            return Session(env, PolicyPilot(policy, None), CONFIG.fall, seed, chance)
        agent, generator = make_agent(name, small(name), env, seed)
        if task == "Imitation":
            return Session(env, AgentPilot(agent), CONFIG.fall, seed)
        decisions = LatentEnv(env, agent, decoder=SphereDecoder(agent.latent_dim))
        policy = TaskAgent(decisions, config, generator)
        return Session(env, PolicyPilot(policy, decisions), CONFIG.fall, seed, chance)

    yield make
    torch.set_num_threads(threads)
