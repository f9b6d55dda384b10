"""Who acts in a session: an agent that is steered by hand, or a policy that has learned a task."""

from typing import Protocol, runtime_checkable

import torch

from murmillo.agents.common.blending import Blending
from murmillo.agents.common.decoder import Command
from murmillo.agents.common.interface import Agent, Labelled, Obs, Steerable, Step
from murmillo.agents.common.latent_env import LatentEnv
from murmillo.agents.common.task_agent import TaskAgent

WORLD = torch.zeros(1, dtype=torch.int64)
"""The one world of a session."""


@runtime_checkable
class SteerableAgent(Agent, Steerable, Protocol):
    """An agent whose latents somebody else may choose."""


class Pilot(Protocol):
    """Acts in one world, a control step at a time."""

    @property
    def judge(self) -> Agent | None:
        """Whose reward terms say how much the motion is like the clips; None where nobody knows."""
        ...

    @property
    def steerable(self) -> SteerableAgent | None:
        """Whose latents the user chooses; None where a policy does."""
        ...

    @property
    def adapted(self) -> Blending | None:
        """Whose adapters may act in part; None where it has none."""
        ...

    @property
    def heeds_skill(self) -> bool:
        """Whether it does as the observation "skill" says."""
        ...

    def act(self, obs: Obs) -> Step:
        """The mean action of a control step."""
        ...

    def reset(self) -> None:
        """Begin a new episode."""
        ...


class AgentPilot:
    """An agent that has learned from clips, under latents of its own until the user chooses one."""

    def __init__(self, agent: Agent) -> None:
        self.judge = agent
        self.steerable = agent if isinstance(agent, SteerableAgent) else None
        self.adapted = _with_adapters(agent)
        self.heeds_skill = isinstance(agent, Labelled)
        self._agent = agent

    def act(self, obs: Obs) -> Step:
        return self._agent.act(obs, deterministic=True)

    def reset(self) -> None:
        self._agent.reset(WORLD)


class PolicyPilot:
    """A policy that has learned a task, on the character itself or by the latents of an agent beneath it."""

    steerable = None

    def __init__(self, policy: TaskAgent, decisions: LatentEnv | None) -> None:
        """`decisions` is what the policy was trained in: how long a decision is, what it means, and to whom."""
        self.judge = None if decisions is None else decisions.low
        self.adapted = _with_adapters(self.judge)
        self.heeds_skill = policy.config.skill
        self._policy, self._decisions = policy, decisions
        self._command: Command | None = None
        self._steps_left = 0

    def act(self, obs: Obs) -> Step:
        if self._decisions is None:
            return self._policy.act(obs, deterministic=True)
        low = self._decisions.low
        if self._command is None or self._steps_left == 0:
            self._command = self._decisions.decoder(self._policy.act(obs, deterministic=True).action)
            self._steps_left = self._decisions.config.steps
            low.follow(self._command.latent)
        self._steps_left -= 1
        return low.act(obs | self._command.observed, deterministic=True)

    def reset(self) -> None:
        self._command = None


def _with_adapters(agent: Agent | None) -> Blending | None:
    return agent if isinstance(agent, Blending) and agent.adapters else None
