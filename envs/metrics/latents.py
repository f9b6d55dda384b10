"""How well a latent space is ordered."""

import torch
import torch.nn.functional as F
from torch import Tensor

_CELLS = 2**23
"""Distances held at a time: 64 MB."""


def fisher_concentration(latent: Tensor, clip: Tensor) -> float:
    """How much closer the encodings of a clip's windows are to each other than to those of all clips (CALM, eq. 9).

    The mean over clips M of

        [ sum_{i, j in M} ||z_i - z_j|| / |M|^2 ] / [ sum_{i in M, k in all} ||z_i - z_k|| / (|M| |all|) ]

    Down is good: 0 where every clip is one point and no two are the same, 1 where clips do not matter. CALM reports
    0.23 for itself and 0.68 for ASE.

    Args:
        latent: [n, Z] encodings of windows, 2 s in the paper, which slide over the clips.
        clip: [n] int64, of which clip each is a window; clips of a single window have no spread and are left out.
    """
    total, counts = _distance_sums(latent, clip)
    within = total.diagonal() / counts.square()
    overall = total.sum(1) / (counts * len(latent))
    return (within / overall)[counts > 1].mean().item()


def class_distances(latent: Tensor, kind: Tensor) -> Tensor:
    """How far the motion classes lie from each other in the latent space (CALM, figure 9).

        d_ab = sum_{i in a, j in b} ||z_i - z_j|| / (|a| |b|)

    The figure's caption does not say what distance it shows; this is the one of eq. 9, so that the diagonal holds the
    numerators of `fisher_concentration`.

    Args:
        latent: [n, Z] encodings of windows.
        kind: [n] int64, the class of each.

    Returns:
        [K, K] float64, symmetric, a row for each of the K classes that occur, in ascending order.
    """
    total, counts = _distance_sums(latent, kind)
    return total / (counts[:, None] * counts)


def _distance_sums(latent: Tensor, kind: Tensor) -> tuple[Tensor, Tensor]:
    """Sum of the distances between the members of each two classes [K, K], and the classes' sizes [K], in float64."""
    latent = latent.double()
    _, row = kind.unique(return_inverse=True)
    member = F.one_hot(row).double()
    total = latent.new_zeros(member.shape[1], member.shape[1])
    rows = max(1, _CELLS // len(latent))
    for points, belongs in zip(latent.split(rows), member.split(rows), strict=True):
        total += belongs.T @ (torch.cdist(points, latent) @ member)
    return total, member.sum(0)
