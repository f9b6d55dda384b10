"""PPO's losses (Schulman et al. 2017) and the Gaussian's quantities, as pure functions of tensors."""

import math

import torch
from torch import Tensor

LOG_2PI = math.log(2 * math.pi)


def gaussian_log_prob(action: Tensor, mean: Tensor, log_std: Tensor) -> Tensor:
    """log N(action; mean, diag std^2) `[...]` of actions `[..., A]`."""
    return -0.5 * (((action - mean) * torch.exp(-log_std)).square() + 2 * log_std + LOG_2PI).sum(-1)


def gaussian_entropy(log_std: Tensor) -> Tensor:
    """Differential entropy [nat] of a diagonal Gaussian, `[...]` from `[..., A]`."""
    return (log_std + 0.5 * (1 + LOG_2PI)).sum(-1)


def ppo_policy_loss(log_prob: Tensor, old_log_prob: Tensor, advantage: Tensor, clip: float) -> Tensor:
    """-E min(r A, clip(r, 1 - clip, 1 + clip) A) with r = pi / pi_old; all `[B]`."""
    ratio = torch.exp(log_prob - old_log_prob)
    return -torch.minimum(ratio * advantage, ratio.clamp(1 - clip, 1 + clip) * advantage).mean()


def value_loss(value: Tensor, target: Tensor) -> Tensor:
    """E (V - R)^2; both `[B]`."""
    return (value - target).square().mean()


def action_bound_loss(mean: Tensor) -> Tensor:
    """E sum_j max(|mu_j| - 1, 0)^2 of means `[B, A]`: keeps the mean where the actuators still answer."""
    return (mean.abs() - 1).clamp(min=0).square().sum(-1).mean()


def approx_kl(log_prob: Tensor, old_log_prob: Tensor) -> Tensor:
    """E [(r - 1) - log r], an unbiased and never negative estimate of KL(pi_old, pi) [nat]; both `[B]`."""
    log_ratio = log_prob - old_log_prob
    return (torch.expm1(log_ratio) - log_ratio).mean()


def clip_fraction(log_prob: Tensor, old_log_prob: Tensor, clip: float) -> Tensor:
    """Share of samples whose ratio has left [1 - clip, 1 + clip]; both `[B]`."""
    return (torch.expm1(log_prob - old_log_prob).abs() > clip).float().mean()
