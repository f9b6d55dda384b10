"""How different from each other the motions of a policy are."""

import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError
from murmillo.envs.metrics.spread import Spread
from murmillo.envs.rotations import heading_quat, quat_rotate_inverse

_BLOCK = 512
"""Motions on each side of a block of distances: memory grows with it, never with the number of pairs."""


def average_pairwise_distance(motion: Tensor) -> float:
    """How far two motions are from each other on average (C·ASE, eq. 10).

        APD = 1 / (N (N - 1)) sum_i sum_{j != i} sqrt( sum_t ||s_t^i - s_t^j||^2 )

    Up is good, 0 where all motions are the same. It is in the features' own units and grows with the root of the
    length, which the paper does not state: compare results over the same features and length only. C·ASE reports
    160.4 ± 1.77 for itself, 145.4 ± 2.11 for ASE and 152.7 ± 1.86 for CALM, over ten draws of N = 10,000.

    Args:
        motion: [N, T, D] states, a frame a control step; any shape after the first is one motion.

    Raises:
        SuiteError: a single motion.
    """
    if len(motion) < 2:
        raise SuiteError(f"average pairwise distance of {len(motion)} motion: record two at least")
    flat = motion.flatten(1)
    # distances come from a matrix product: its rounding is least about the origin
    centre = flat.mean(0, dtype=torch.float64).to(flat)
    total = 0.0
    for start in range(0, len(flat), _BLOCK):
        rows = flat[start : start + _BLOCK] - centre
        for other in range(start, len(flat), _BLOCK):
            columns = rows if other == start else flat[other : other + _BLOCK] - centre
            distance = torch.cdist(rows, columns, compute_mode="use_mm_for_euclid_dist")
            total += (distance.triu(1) if other == start else distance).sum(dtype=torch.float64).item()
    return total / (len(flat) * (len(flat) - 1) / 2)


def repeated_distance(motion: Tensor, size: int, draws: int, generator: torch.Generator) -> Spread:
    """The average pairwise distance of several draws, as C·ASE reports it: ten of 10,000 motions.

    No motion is in two draws: draws that overlapped would look more alike than those of fresh motions.

    Args:
        motion: [n, T, D] with n >= size * draws.
        generator: decides which motion is in which draw.

    Raises:
        SuiteError: fewer motions than the draws need.
    """
    if size * draws > len(motion):
        raise SuiteError(
            f"{draws} draws of {size} motions need {size * draws}: there are {len(motion)}; "
            f"record more or draw {len(motion) // draws} at a time"
        )
    order = torch.randperm(len(motion), generator=generator)[: size * draws]
    values = [average_pairwise_distance(motion[chosen]) for chosen in order.split(size)]
    return Spread.of(torch.tensor(values, dtype=torch.float64))


def most_diverse(motion: Tensor, k: int) -> Tensor:
    """The k skills whose own motions differ most (C·ASE, figure 9: ten, ranked by the distance within the skill).

    Args:
        motion: [S, n, T, D] states of n motions under each of S skills, all from one initial state.
        k: at most S.

    Returns:
        [k] int64, numbers of skills, the most diverse first; of equals the lower number.
    """
    distance = torch.tensor([average_pairwise_distance(one) for one in motion], dtype=torch.float64)
    return distance.argsort(descending=True, stable=True)[:k]


def root_paths(root_pos_w: Tensor, root_quat_w: Tensor) -> Tensor:
    """Where the root goes on the ground, seen from where it started (C·ASE, figure 9).

    Args:
        root_pos_w: [..., T, 3] [m].
        root_quat_w: [..., T, 4].

    Returns:
        [..., T, 2] [m] from the first position; the first heading points along +x.
    """
    start = heading_quat(root_quat_w[..., :1, :])
    return quat_rotate_inverse(start, root_pos_w - root_pos_w[..., :1, :])[..., :2]
