"""How many of the clips a policy's trajectories reproduce (ASE section 10.4, C·ASE section 5)."""

import math
from collections.abc import Sequence
from fractions import Fraction

import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError


def majority_clip(nearest: Tensor, clips: int, counted: Tensor | None = None) -> Tensor:
    """The clip that most transitions of a trajectory are nearest to (ASE section 10.4).

    Args:
        nearest: [n, T] int64 clip of each transition, from `ClipMatcher.nearest`.
        clips: number of clips, those that are not distinct included.
        counted: [n, T] bool, the transitions that have a vote; all of them where it is left out.

    Returns:
        [n] int64; where several clips have as many transitions, the lowest.
    """
    votes = torch.ones_like(nearest) if counted is None else counted.long()
    return nearest.new_zeros(len(nearest), clips).scatter_add_(1, nearest, votes).argmax(1)


def frequencies(matched: Tensor, distinct: Sequence[int]) -> Tensor:
    """How many trajectories match each clip: l_i of C·ASE, eq. 9, and the bars of its Fig. 5.

    Args:
        matched: [n] int64 clip of each trajectory.
        distinct: the K clips that count, from `ClipMatcher.distinct`. Where several clips make up one skill, as with
            C·ASE's Composite Skills, both may be numbers of skills instead.

    Returns:
        [K] int64, in the order of `distinct`.

    Raises:
        SuiteError: a match that is not in `distinct`.
    """
    return torch.bincount(positions(matched, distinct), minlength=len(distinct))


def coverage(matched: Tensor, distinct: Sequence[int]) -> float:
    """The share of clips that at least one trajectory matches: what ASE's Fig. 10 shows, C·ASE's eq. 9 at rate 0.

    Args:
        matched, distinct: as in `frequencies`.
    """
    return filtered_coverage(matched, distinct, 0.0)


def filtered_coverage(matched: Tensor, distinct: Sequence[int], rate: float) -> float:
    """The share of clips that trajectories match often enough not to be chance (C·ASE, eq. 9).

        (1 / K) sum_i 1[l_i > rate N / K]

    A clip that is matched exactly rate N / K times is not covered. C·ASE: 10,000 trajectories, rates of 0 to 50 %.

    Args:
        matched, distinct: as in `frequencies`.
        rate: the filtering rate gamma, 0 to 1. It is taken as the decimal that is written, not as the nearest binary
            fraction, so that the comparison is exact.
    """
    expected = Fraction(len(matched), len(distinct))
    least = math.floor(Fraction(str(rate)) * expected) + 1
    return (frequencies(matched, distinct) >= least).double().mean().item()


def positions(matched: Tensor, distinct: Sequence[int]) -> Tensor:
    """[n] int64 place of each match in `distinct`.

    Raises:
        SuiteError: a match that is not in `distinct`.
    """
    known = torch.tensor(distinct, device=matched.device)
    same = matched[:, None] == known
    missing = ~same.any(1)
    if missing.any():
        raise SuiteError(
            f"coverage: clip {matched[missing][0].item()} is matched but not among the {len(known)} distinct clips; "
            "take both from one ClipMatcher"
        )
    return same.long().argmax(1)
