"""Policy, critics and normalisers of each way to adapt, put together."""

import torch
from torch import Tensor

from murmillo.agents.adaptnet.config import AdaptNetConfig
from murmillo.agents.adaptnet.networks import LENGTH, HistoryCritic, HistoryEncoder, ProgressivePolicy, RecurrentPolicy
from murmillo.agents.adaptnet.spaces import Observed
from murmillo.agents.common.adapter import Adapter, Views
from murmillo.agents.common.base import Base
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.heights import HEIGHTS, HeightMapEncoder
from murmillo.agents.common.networks import Policy
from murmillo.agents.common.normalizer import RunningNormalizer
from murmillo.agents.common.popart import PopArt
from murmillo.agents.common.ppo import ActorCritic
from murmillo.agents.common.rollout import Rollout


class HistoryActorCritic(ActorCritic):
    """Policy and critics on the last states, whose returns PopArt normalises."""

    def __init__(
        self,
        observed: Observed,
        policy: Policy,
        state_normalizer: RunningNormalizer | Views,
        objectives: int,
        config: AdaptNetConfig,
        generator: torch.Generator,
    ) -> None:
        encoder = _encoder(observed, config, generator, HEIGHTS in observed.told)
        critic = HistoryCritic(encoder, config.ppo.hidden, objectives, generator)
        super().__init__(
            observed.state_dim,
            observed.action_dim,
            0,
            config.ppo,
            generator,
            policy,
            critic=critic,
            state_normalizer=state_normalizer,
            return_normalizer=PopArt(critic.head, config.popart),
        )

    def targets(self, rollout: Rollout) -> Tensor:
        """Normalised returns `[T N, C]`, by statistics that already know them: PopArt's update moves no prediction."""
        self.return_normalizer.update(rollout["return"], ranks=rollout.ranks)
        return super().targets(rollout)

    def observe(self, rollout: Rollout) -> None:
        """Let the states' normaliser learn from the valid frames."""
        states = rollout["state"]
        if LENGTH in rollout:
            states = states[torch.arange(states.shape[-2]) < rollout[LENGTH][..., None]]
        self.state_normalizer.update(states, ranks=rollout.ranks)


def make_model(
    observed: Observed, objectives: int, config: AdaptNetConfig, generator: torch.Generator, base: Base | None
) -> HistoryActorCritic:
    """A model that begins from nothing, or from a base as `config.method` says; the critics are always new.

    Raises:
        AgentError: the base does not fit the environment or the config.
    """
    sizes = (config.ppo.hidden, config.ppo.std, generator, config.ppo.std_least)
    maps = HEIGHTS in observed.told
    if base is None:
        policy = RecurrentPolicy(_encoder(observed, config, generator, maps), observed.action_dim, *sizes)
        normalizer = RunningNormalizer((observed.state_dim,))
        return HistoryActorCritic(observed, policy, normalizer, objectives, config, generator)

    seen_maps = any(name.startswith("encoder.controls") for name in base.policy)
    if seen_maps and not maps:
        raise AgentError(
            "the base acts by a map of heights, the environment shows none; give it uneven ground, or name another base"
        )
    encoder = _encoder(observed, config, generator, seen_maps)
    plain = RecurrentPolicy(encoder, observed.action_dim, *sizes)
    if config.method == "adaptnet":
        control = HeightMapEncoder(generator) if maps and not seen_maps else None
        size = HeightMapEncoder.size if control is not None else 0
        policy, views = base.adapted(
            plain, observed.state_dim, lambda own: Adapter(own, config.adapter, generator, control, size)
        )
        return HistoryActorCritic(observed, policy, views, objectives, config, generator)
    own, views = base.adopt(plain, observed.state_dim)
    if config.method == "finetune":
        return HistoryActorCritic(observed, own, views.normalizers[1], objectives, config, generator)
    encoder = _encoder(observed, config, generator, maps)
    policy = ProgressivePolicy(own, encoder, *sizes)
    return HistoryActorCritic(observed, policy, views, objectives, config, generator)


def _encoder(observed: Observed, config: AdaptNetConfig, generator: torch.Generator, maps: bool) -> HistoryEncoder:
    controls = [HeightMapEncoder(generator)] if maps else []
    return HistoryEncoder(observed.state_dim, observed.goal_dim, config.recurrent, generator, controls)
