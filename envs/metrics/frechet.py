"""How far the distribution of what a policy does is from that of the clips."""

import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError

_ROWS = 4096
"""Samples that are taken to double precision at a time."""


def frechet_distance(a: Tensor, b: Tensor) -> float:
    """Fréchet distance of the Gaussians with the samples' means and covariances (Heusel et al. 2017, eq. 6).

        ||m_a - m_b||^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2))

    Down is good, 0 for identical samples. It is what C·ASE's Table 1 calls FID, on the raw state features of single
    frames, transitions (2 frames) and clips (30 frames). Being in the features' own units, squared, it compares results
    over the same features and the same number of samples only: few samples of many features are biased upwards.

    With centred samples X of n rows, C = X^T X / (n - 1) = R^T R, and tr((C_a C_b)^(1/2)) is the sum of the singular
    values of R_a R_b^T. No root of a covariance is taken, so that singular ones, as of fewer samples than features,
    lose no accuracy.

    Args:
        a: [n, ...] samples, any shape of features: `windows(motion, frames)`.
        b: [m, ...] samples of the same shape; which is a and which b does not matter.

    Raises:
        SuiteError: a single sample, which has no covariance.
    """
    mean_a, factor_a = _gaussian(a.flatten(1))
    mean_b, factor_b = _gaussian(b.flatten(1))
    shift = (mean_a - mean_b).square().sum()
    spread = factor_a.square().sum() + factor_b.square().sum()
    common = torch.linalg.svdvals(factor_a @ factor_b.T).sum()
    return (shift + spread - 2 * common).clamp_min(0.0).item()


def _gaussian(samples: Tensor) -> tuple[Tensor, Tensor]:
    """Mean [D] and a factor R [min(n, D), D] of the covariance R^T R, both float64, of samples [n, D]."""
    if len(samples) < 2:
        raise SuiteError(f"Fréchet distance of {len(samples)} sample: a covariance needs two at least; record more")
    mean = samples.mean(0, dtype=torch.float64)
    factor = mean.new_empty(0, len(mean))
    for block in samples.split(_ROWS):
        factor = torch.linalg.qr(torch.cat((factor, block - mean)), mode="r").R
    return mean, factor / (len(samples) - 1) ** 0.5
