"""Which clips a policy can follow by which (ASE section 10.4 and Fig. 9, C·ASE section 5 and Fig. 7).

A trajectory acts under one latent (and label), drawn at random, until it is switched to another. ASE switches after
150 to 200 steps, drawn anew for each trajectory, and goes on to the end of the episode; C·ASE acts for 200 steps under
each. ASE has about 1,000 trajectories, C·ASE 10,000. An episode must not end at the switch, nor be reset in between.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from murmillo.envs.metrics.coverage import majority_clip, positions


def source_and_destination(nearest: Tensor, switch: Tensor, clips: int) -> tuple[Tensor, Tensor]:
    """The clips that trajectories match before and after the switch.

    The transition from state t to t + 1 belongs to the latent that chose action t. With h actions under the first
    latent, the source is transitions 0 to h - 1, between states 0 and h, and the destination the rest, from state h on:
    both sub-trajectories have that state, and no transition is in both.

    Args:
        nearest: [n, T] int64 clip of each transition of the whole trajectory.
        switch: [n] int64, how many steps each acted under its first latent; above 0 and below T.
        clips: number of clips, those that are not distinct included.

    Returns:
        source [n] and destination [n] int64.
    """
    before = torch.arange(nearest.shape[1], device=nearest.device) < switch[:, None]
    return majority_clip(nearest, clips, before), majority_clip(nearest, clips, ~before)


def transition_matrix(source: Tensor, destination: Tensor, distinct: Sequence[int]) -> Tensor:
    """The probability of going on to each clip, given the one before.

    ASE's Fig. 9 has the sources in its columns, so it shows the transpose, of the 50 clips matched most often.

    Args:
        source, destination: [n] int64 clip of each trajectory's two parts.
        distinct: the K clips that count.

    Returns:
        [K, K] float64, in the order of `distinct`: a row a source, which sums to 1, or to 0 where no trajectory has it.

    Raises:
        SuiteError: a match that is not in `distinct`.
    """
    count = _counts(source, destination, distinct).double()
    return count / count.sum(1, keepdim=True).clamp_min(1.0)


def transition_coverage(source: Tensor, destination: Tensor, distinct: Sequence[int]) -> float:
    """The share of the K x K pairs of clips, a clip followed by itself included, that some trajectory shows.

    n trajectories cannot show more than n of them: 1,000 reach 14 % of the pairs of 84 clips at the most.

    Args:
        source, destination, distinct: as in `transition_matrix`.
    """
    return (_counts(source, destination, distinct) > 0).double().mean().item()


def _counts(source: Tensor, destination: Tensor, distinct: Sequence[int]) -> Tensor:
    clips = len(distinct)
    pair = positions(source, distinct) * clips + positions(destination, distinct)
    return torch.bincount(pair, minlength=clips * clips).unflatten(0, (clips, clips))
