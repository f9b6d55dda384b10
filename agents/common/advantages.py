"""Generalised advantage estimation (Schulman et al. 2015) that keeps an end and a time limit apart."""

from collections.abc import Sequence

import torch
from torch import Tensor

from murmillo.agents.common.ranks import ALONE, Ranks


def gae(
    reward: Tensor, value: Tensor, next_value: Tensor, terminated: Tensor, done: Tensor, gamma: float, lam: float
) -> Tensor:
    """Advantages `[T, N]`, or `[T, N, C]` of C objectives at once; add `value` for the TD(lambda) targets.

        delta_t = r_t + gamma (1 - terminated_t) V(s'_t) - V(s_t)
        A_t     = delta_t + gamma lam (1 - done_t) A_{t+1}

    A termination has no future. A truncation has one, `next_value` of the true last observation. Both cut the trace.

    Args:
        reward: `[T, N]` or `[T, N, C]`.
        value: V(s_t), shaped like the reward.
        next_value: V of the true successor, shaped like the reward.
        terminated: bool `[T, N]`, the episode ended in failure or success.
        done: bool `[T, N]`, terminated or truncated.
        gamma: discount.
        lam: trace decay.
    """
    if reward.dim() > terminated.dim():
        terminated, done = terminated[..., None], done[..., None]
    delta = reward + gamma * next_value * ~terminated - value
    decay = gamma * lam * (~done).to(reward.dtype)
    advantage = torch.empty_like(delta)
    trace = torch.zeros_like(delta[0])
    for t in reversed(range(len(delta))):
        trace = delta[t] + decay[t] * trace
        advantage[t] = trace
    return advantage


def normalise_advantage(advantage: Tensor, eps: float = 1e-5, *, ranks: Ranks = ALONE) -> Tensor:
    """Mean 0 and standard deviation 1 over the whole rollout, any shape, of all ranks together."""
    std, mean = torch.std_mean(advantage, correction=0)
    if ranks.size > 1:
        _, mean, var = ranks.moments(advantage.numel(), mean, std.square())
        std = var.sqrt()
    return (advantage - mean) / (std + eps)


def weigh_advantages(advantage: Tensor, weights: Sequence[float], *, ranks: Ranks = ALONE) -> Tensor:
    """What the policy follows, `[T, N]`: the sum of weight times normalised advantage over objectives `[T, N, C]`.

    Each objective is normalised by itself, so that none drowns the others by its scale (AdaptNet, eq. 9).
    """
    normalised = [normalise_advantage(objective, ranks=ranks) for objective in advantage.unbind(-1)]
    return torch.stack([weight * one for weight, one in zip(weights, normalised, strict=True)]).sum(0)
