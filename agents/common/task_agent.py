"""PPO for a task, from the state and the goal: a policy of latents, or one that acts itself."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import torch
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from torch import Tensor
from torch.nn import functional as F

from murmillo.agents.common.dimensions import action_size, skill_count
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Obs, Step
from murmillo.agents.common.networks import GaussianPolicy
from murmillo.agents.common.ppo import PPO, ActorCritic, Minibatch, PPOConfig, action_noise
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.training import load_parts, named, state_of

MakePolicy = Callable[[int, int, int], GaussianPolicy]
"""From the sizes of input, action and condition."""


@dataclass
class TaskAgentConfig:
    """A high-level policy's hyperparameters (ASE, section 8.2 and table 3); gamma and lambda are the runner's.

    The policy's mean begins at the origin of the latents, from where they are explored alike (section 7.1). The
    released code squashes it with tanh; here the bound loss keeps it within [-1, 1], as it does everywhere.

    Attributes:
        skill: it sees the commanded skill too, as C·ASE's user-controlled policies do; in CALM's precision training a
            skill stands for a style.
        ppo: policy and critic.
    """

    skill: bool = False
    ppo: PPOConfig = field(
        default_factory=lambda: PPOConfig(hidden=(1024, 512), style_hidden=(), std=0.1, mean_init_scale=0.0)
    )


class TaskAgent:
    """A policy pi(a | s, g) that maximises what the environment rewards; it knows neither motions nor discriminator.

    In a `LatentEnv` its actions are latents, directly in an environment they are the character's (ASE's "Scratch"). The
    goal is a part of the input where the environment has one.
    """

    def __init__(
        self,
        env: VectorEnv,
        config: TaskAgentConfig,
        generator: torch.Generator,
        make_policy: MakePolicy | None = None,
        *,
        ranks: Ranks = ALONE,
    ) -> None:
        """
        Args:
            env: read for its spaces only.
            config: hyperparameters.
            generator: draws weights, noise and minibatches.
            make_policy: for actions that are not Gaussian.
            ranks: who train it together.

        Raises:
            AgentError: the environment has no "state", no "skill" where it is asked for, or actions that are no vector.
        """
        self.config = config
        self.generator = generator
        self.ranks = ranks
        observed, action_dim = _observed(env), action_size(env)
        self._inputs = [name for name in ("state", "goal") if name in observed]
        self._told = ("skill",) if config.skill else ()
        self._skills = skill_count(env) if config.skill else 0
        self.needs = frozenset(prefix + name for name in (*self._inputs, *self._told) for prefix in ("", "next_"))
        width = sum(spaces.flatdim(observed[name]) for name in self._inputs)
        policy = make_policy(width, action_dim, self._skills) if make_policy else None
        self.model = ActorCritic(width, action_dim, self._skills, config.ppo, generator, policy)
        self.ppo = PPO(self.model, config.ppo)
        self.noise = action_noise(config.ppo, generator, ranks)
        self._parts = {"ppo": self.ppo, "noise": self.noise}

    def act(self, obs: Obs, *, deterministic: bool = False) -> Step:
        noise = None if deterministic else self.noise
        return Step(*self.model.act(self._input(obs), self._condition(obs), noise), quiet=self.noise.quiet)

    def value(self, obs: Obs, extras: dict[str, Tensor]) -> Tensor:
        return self.model.value(self._input(obs), self._condition(obs))

    def reset(self, env_ids: Tensor) -> None:
        """Nothing lasts from step to step."""

    def rewards(self, rollout: Rollout) -> dict[str, Tensor]:
        """None of its own: what counts is the environment's."""
        return {}

    def update(self, rollout: Rollout) -> dict[str, float]:
        """One iteration of PPO."""
        seen = rollout.alike()
        for name in ("action", "log_prob", "advantage", "return", *self._told):
            seen[name] = rollout[name]
        seen["state"] = self._input({name: rollout[name] for name in self._inputs})
        return named("ppo", self.ppo.update(seen, self.generator, fields=self._told, condition=self._condition))

    def _input(self, obs: Obs) -> Tensor:
        """State and goal `[..., D + G]`."""
        return torch.cat([obs[name] for name in self._inputs], -1)

    def _condition(self, obs: Obs | Minibatch) -> Tensor | None:
        """The commanded skill, one-hot `[..., K]`."""
        return F.one_hot(obs["skill"], self._skills).float() if self._told else None

    def state_dict(self) -> dict[str, Any]:
        return state_of(self._parts)

    def load_state_dict(self, state: dict[str, Any]) -> None:
        load_parts(self._parts, state)


def _observed(env: VectorEnv) -> dict[str, spaces.Space]:
    """What is observed, by name."""
    space = env.single_observation_space
    if not isinstance(space, spaces.Dict) or "state" not in space.spaces:
        raise AgentError(f"the agent needs a dict observation with 'state'; the environment's is {space}")
    return dict(space.spaces)
