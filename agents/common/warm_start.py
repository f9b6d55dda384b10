"""A head start: regress the policy on the clips' own next poses before the first rollout."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch.nn import functional as F

from murmillo.agents.common.interface import ImitationPairs
from murmillo.agents.common.networks import Told
from murmillo.agents.common.numbers import check_at_least
from murmillo.agents.common.ppo import ActorCritic
from murmillo.agents.common.training import adam

_CONDITIONS = 16
"""Minibatches of conditions, drawn once: those of CALM are encodings of motions, and dear."""


@dataclass
class WarmStartConfig:
    """
    Attributes:
        steps: gradient steps; 0 for no warm start.
        pairs: drawn from the clips once, which costs more than many steps on them.
        minibatch: pairs a step.
        learning_rate: Adam's step.
    """

    steps: int = 0
    pairs: int = 32768
    minibatch: int = 1024
    learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        check_at_least(0, self, "warm_start", "steps", "learning_rate")
        check_at_least(1, self, "warm_start", "pairs", "minibatch")


def warm_start(
    model: ActorCritic,
    pairs: ImitationPairs,
    config: WarmStartConfig,
    generator: torch.Generator,
    condition: Callable[[int], Told] = lambda n: None,
) -> list[float]:
    """Minimise E ||mu(s, c) - a||^2 / A over (s, a) of the clips and random conditions; the critic stays as it is.

    The state normaliser learns from these states too, since the policy should meet its inputs at their final scale.

    Args:
        model: whose policy is fitted.
        pairs: draws states and the actions that lead on along the clip.
        config: how long and how fast.
        generator: draws pairs.
        condition: draws what the policy is told of n states at random: conditions `[n, C]`, or named tensors.

    Returns:
        the loss of every step.
    """
    data = pairs(config.pairs, generator)
    action = data["action"].float()
    model.state_normalizer.update(data["state"])
    state = model.state_normalizer(data["state"])
    conditions = [condition(config.minibatch) for _ in range(_CONDITIONS)]
    optimizer = adam((model.policy.parameters(), config.learning_rate))
    losses: list[float] = []
    for step in range(config.steps):
        rows = torch.randint(config.pairs, (config.minibatch,), generator=generator)
        mean = model.policy.mode(model.policy(state[rows], conditions[step % _CONDITIONS]))
        loss = F.mse_loss(mean, action[rows])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    return losses
