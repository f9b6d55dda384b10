"""How well a latent space is ordered."""

import torch
from torch import Tensor


def fisher_concentration(latent: Tensor, clip: Tensor) -> float:
    """How much closer the encodings of a clip's windows are to each other than to those of all clips (CALM, eq. 9).

    The mean over clips M of

        [ sum_{i, j in M} ||z_i - z_j|| / |M|^2 ] / [ sum_{i in M, k in all} ||z_i - z_k|| / (|M| |all|) ]

    Down is good: 0 where every clip is one point and no two are the same, 1 where clips do not matter. CALM reports
    0.23 for itself and 0.68 for ASE. NaN where no clip has two windows.

    Args:
        latent: [n, Z] encodings of windows, 2 s in the paper, which slide over the clips.
        clip: [n] int64, of which clip each is a window; clips of a single window have no spread and are left out.
    """
    distance = torch.cdist(latent, latent)
    member = (clip.unique()[:, None] == clip).to(distance)
    counts = member.sum(1)
    within = ((member @ distance) * member).sum(1) / counts.square()
    overall = (member @ distance).sum(1) / (counts * len(latent))
    return (within / overall)[counts > 1].mean().item()
