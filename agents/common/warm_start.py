"""A head start: regress the policy on the clips' own next poses before the first rollout."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional as F

from murmillo.agents.common.interface import ImitationPairs
from murmillo.agents.common.networks import Told
from murmillo.agents.common.numbers import check_at_least
from murmillo.agents.common.ppo import ActorCritic
from murmillo.agents.common.training import adam

_CONDITIONS = 16
"""Minibatches of labels, whose conditions are drawn once: those of CALM are encodings of motions, and dear."""


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
    condition: Callable[[Tensor], Told] = lambda skill: None,
) -> list[float]:
    """Minimise E ||mu(s, c) - a||^2 / A over (s, a) of the clips and conditions c of their labels; the critic stays.

    Under labels of other clips the policy would learn to be deaf to them. The state normaliser learns from these states
    too, since the policy should meet its inputs at their final scale.

    Args:
        model: whose policy is fitted.
        pairs: draws states and the actions that lead on along the clip.
        config: how long and how fast.
        generator: draws pairs.
        condition: draws what the policy is told in states of clips with these labels `[n]`: conditions `[n, C]`, or
            named tensors.

    Returns:
        the loss of every step.
    """
    data = pairs(config.pairs, generator)
    action = data["action"].float()
    model.state_normalizer.update(data["state"])
    state = model.state_normalizer(data["state"])
    skill = data["skill"]
    of_skill, count = torch.argsort(skill, stable=True), torch.bincount(skill)
    first = count.cumsum(0) - count
    labels = skill[torch.randint(config.pairs, (_CONDITIONS, config.minibatch), generator=generator)]
    conditions = [condition(some) for some in labels]
    optimizer = adam((model.policy.parameters(), config.learning_rate))
    losses: list[float] = []
    for step in range(config.steps):
        wanted = labels[step % _CONDITIONS]
        place = torch.rand(config.minibatch, generator=generator) * count[wanted]
        rows = of_skill[first[wanted] + place.long()]
        losses.append(regress(model, optimizer, state[rows], conditions[step % _CONDITIONS], action[rows]))
    return losses


def regress(model: ActorCritic, optimizer: torch.optim.Optimizer, state: Tensor, told: Told, action: Tensor) -> float:
    """One step of the policy towards the actions [n, A] in these normalised states [n, S]; the mean squared error."""
    loss = F.mse_loss(model.policy.mode(model.policy(state, told)), action)
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    return loss.item()
