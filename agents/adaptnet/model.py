"""Policy, critics and normalisers of each way to adapt, put together."""

import copy

import torch
from torch import Tensor

from murmillo.agents.adaptnet.base import Base
from murmillo.agents.adaptnet.config import AdaptNetConfig
from murmillo.agents.adaptnet.networks import (
    HEIGHTS,
    LENGTH,
    HeightMapEncoder,
    HistoryCritic,
    HistoryEncoder,
    ProgressivePolicy,
    RecurrentPolicy,
)
from murmillo.agents.adaptnet.spaces import Observed
from murmillo.agents.common.adapter import AdaptedPolicy, Adapter, Views
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.networks import Policy
from murmillo.agents.common.normalizer import RunningNormalizer
from murmillo.agents.common.popart import PopArt
from murmillo.agents.common.ppo import ActorCritic
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.training import load_module


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
    hidden, std = config.ppo.hidden, config.ppo.std
    maps = HEIGHTS in observed.told
    if base is None:
        policy = RecurrentPolicy(
            _encoder(observed, config, generator, maps), observed.action_dim, hidden, std, generator
        )
        normalizer = RunningNormalizer((observed.state_dim,))
        return HistoryActorCritic(observed, policy, normalizer, objectives, config, generator)

    if base.actions != observed.action_dim:
        raise AgentError(
            f"the base acts with {base.actions} numbers, the environment takes {observed.action_dim}; "
            "prune the outputs of joints that are locked"
        )
    seen_maps = any(name.startswith("encoder.controls") for name in base.policy)
    if seen_maps and not maps:
        raise AgentError(
            "the base acts by a map of heights, the environment shows none; give it uneven ground, or name another base"
        )
    own = RecurrentPolicy(_encoder(observed, config, generator, seen_maps), base.actions, hidden, std, generator)
    load_module(own, base.policy, "base policy")
    frozen = RunningNormalizer((observed.state_dim,))
    load_module(frozen, base.normalizer, "base's normaliser")
    learning = _restarted(frozen)
    frozen.freeze()
    if config.method == "finetune":
        return HistoryActorCritic(observed, own, learning, objectives, config, generator)
    views = Views(frozen, learning)
    if config.method == "progressive":
        encoder = _encoder(observed, config, generator, maps)
        policy = ProgressivePolicy(own, encoder, hidden, std, generator)
    else:
        control = HeightMapEncoder(generator) if maps and not seen_maps else None
        size = HeightMapEncoder.size if control is not None else 0
        policy = AdaptedPolicy(own, Adapter(own, config.adapter, generator, control, size))
    return HistoryActorCritic(observed, policy, views, objectives, config, generator)


def _encoder(observed: Observed, config: AdaptNetConfig, generator: torch.Generator, maps: bool) -> HistoryEncoder:
    controls = [HeightMapEncoder(generator)] if maps else []
    return HistoryEncoder(observed.state_dim, observed.goal_dim, config.recurrent, generator, controls)


def _restarted(normalizer: RunningNormalizer) -> RunningNormalizer:
    """A copy that learns on as if it had seen one sample only (released code)."""
    fresh = copy.deepcopy(normalizer)
    fresh.frozen.fill_(False)
    fresh.count.fill_(1.0)
    return fresh
