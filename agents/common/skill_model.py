"""Policy and critic of the methods whose policies are told latents or labels; with a base, an adaptation of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import torch
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from torch import Tensor, nn

from murmillo.agents.common.adaptation import AdaptationConfig, announce, penalties
from murmillo.agents.common.adapter import Adapter
from murmillo.agents.common.base import Base
from murmillo.agents.common.heights import HEIGHTS, HeightMapEncoder, check_map
from murmillo.agents.common.networks import CONDITION, Critic, Told, by_name
from murmillo.agents.common.ppo import ActorCritic, Minibatch, PPOConfig, gaussian_policy

PROGRESS, PROGRESS_SIZE = "progress", 10
"""The observation of how a clip is followed, for critics."""


@dataclass
class SkillConfig(AdaptationConfig):
    """What the configurations of ASE, CALM and C·ASE begin with.

    Attributes:
        ppo: policy and critic.
        critic_progress: whether the critic is shown how far along which clip each world is and how well it follows it
            (`env.tracking`), of which the state says little and the reward depends on; the policy never is.
    """

    critic_progress: bool = False
    ppo: PPOConfig = field(default_factory=PPOConfig)


class SkillModel(ActorCritic):
    """Policy and critic under a latent, a label or both.

    With a base the policy is the base's, frozen, with an adapter that learns, and the critic is new: the skill
    interface stays as it is. Where the environment shows its ground, adapter and critic see that too.

    Attributes:
        seen: observations that both are told beside the condition.
    """

    seen: tuple[str, ...] = ()

    def __init__(
        self,
        env: VectorEnv,
        state_dim: int,
        action_dim: int,
        condition_dim: int,
        config: SkillConfig,
        generator: torch.Generator,
        base: Base | None = None,
    ) -> None:
        """
        Args:
            env: read for whether it shows a map of heights.
            state_dim: D.
            action_dim: A.
            condition_dim: C, size of latent and label together.
            config: sizes of the networks, and how a base is adapted.
            generator: draws the initial weights.
            base: the policy to adapt; None to make one from nothing.

        Raises:
            AgentError: the base does not fit the environment or the config.
        """
        if base is None:
            critic = SightedCritic(state_dim, condition_dim, config, generator) if config.critic_progress else None
            super().__init__(state_dim, action_dim, condition_dim, config.ppo, generator, critic=critic)
        else:
            plain = gaussian_policy(state_dim, action_dim, condition_dim, config.ppo, generator)
            maps = _shows_heights(env)
            control, other = (HeightMapEncoder(generator) if maps else None for _ in range(2))
            size = HeightMapEncoder.size if maps else 0
            policy, views = base.adapted(
                plain, state_dim, lambda own: Adapter(own, config.adapter, generator, control, size)
            )
            critic = SightedCritic(state_dim, condition_dim, config, generator, other)
            super().__init__(
                state_dim,
                action_dim,
                condition_dim,
                config.ppo,
                generator,
                policy,
                critic=critic,
                state_normalizer=views,
            )
            self.seen = (HEIGHTS,) if maps else ()
        if config.critic_progress and _shows(env, PROGRESS):
            self.seen = (*self.seen, PROGRESS)
        self._config = config

    @property
    def needs(self) -> frozenset[str]:
        """What its agent reads again after collection."""
        return frozenset(
            {"next_window", *(prefix + name for name in ("state", *self.seen) for prefix in ("", "next_"))}
        )

    def told(self, condition: Tensor, obs: Mapping[str, Tensor]) -> Told:
        """What policy and critic are told: conditions `[..., C]`, and what they see of these observations."""
        return {CONDITION: condition, **{name: obs[name] for name in self.seen}} if self.seen else condition

    def tell(self, condition: Tensor, batch: Minibatch) -> Told:
        """The same of a minibatch, which keeps what `penalties` asks for."""
        return announce(self.policy, batch, self.told(condition, batch))

    def penalties(self, batch: Minibatch) -> dict[str, Tensor]:
        """What it costs to depart from the base, by name; nothing without one."""
        return penalties(self.policy, batch, self._config)


class SightedCritic(nn.Module):
    """A critic that sees the newest of several `Views`, the map of heights if there is one, and progress if asked to.

    Who plays a policy follows no clip, and does not ask its critic.
    """

    def __init__(
        self,
        state_dim: int,
        condition_dim: int,
        config: SkillConfig,
        generator: torch.Generator,
        control: HeightMapEncoder | None = None,
    ) -> None:
        super().__init__()
        self.state_dim = state_dim
        self.control = control
        self.progress = config.critic_progress
        width = condition_dim + (0 if control is None else control.size) + (PROGRESS_SIZE if self.progress else 0)
        self.critic = Critic(state_dim, width, config.ppo.hidden, generator)

    def forward(self, state: Tensor, told: Told) -> Tensor:
        """`[...]` from normalised states `[..., V D]` and what is told."""
        parts = by_name(told)
        condition = parts[CONDITION]
        if self.control is not None:
            condition = torch.cat([condition, self.control(told)], -1)
        if self.progress:
            condition = torch.cat([condition, parts[PROGRESS]], -1)
        return self.critic(state[..., -self.state_dim :], condition)


def _shows_heights(env: VectorEnv) -> bool:
    """Whether the environment shows a map of heights; an AgentError where that is of another size than is read."""
    if not _shows(env, HEIGHTS):
        return False
    check_map(tuple(env.single_observation_space[HEIGHTS].shape or ()))  # type: ignore[index] # a Dict, as just seen
    return True


def _shows(env: VectorEnv, name: str) -> bool:
    space = env.single_observation_space
    return isinstance(space, spaces.Dict) and name in space.spaces
