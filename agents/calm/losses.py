"""What gives CALM's latent space its structure, as pure functions (CALM, eqs. 5 and 6; Wang and Isola 2020)."""

import torch
from torch import Tensor


def alignment_loss(z: Tensor, overlapping: Tensor) -> Tensor:
    """E ||E(M) - E(M')||^2 of the encodings `[B, Z]` of overlapping motions (eq. 5)."""
    return (z - overlapping).square().sum(-1).mean()


def uniformity_loss(z: Tensor) -> Tensor:
    """log E exp(-2 ||E(M) - E(M')||^2) over all pairs of different rows of `z` `[B, Z]` (eq. 6)."""
    square = 2.0 - 2.0 * z @ z.T  # unit length
    pairs = torch.triu_indices(len(z), len(z), offset=1)
    return (-2.0 * square[pairs[0], pairs[1]]).exp().mean().log()
