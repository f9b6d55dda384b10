"""Figures of a few seeds: interquartile mean and stratified bootstrap.

After Agarwal et al. 2021, "Deep reinforcement learning at the edge of the statistical precipice" (section 4), with the
conventions of their library rliable: a quarter of the scores, rounded down, is cut off at either end, and the interval
is the percentile one.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

LEVEL = 0.95
RESAMPLES = 10_000

Statistic = Callable[..., np.ndarray]
"""A function of scores that takes the `axis` to reduce, such as `np.mean`."""


class Summary(NamedTuple):
    """Scores of one figure over seeds.

    Attributes:
        scores: the figure of each seed.
        mean: of all.
        iqm: their interquartile mean.
        interval: 95 % bootstrap interval of the interquartile mean; None of a single seed.
    """

    scores: tuple[float, ...]
    mean: float
    iqm: float
    interval: tuple[float, float] | None


def summarise(scores: Sequence[float]) -> Summary:
    """The summary of a figure's scores, one a seed; the same scores always give the same interval."""
    values = np.asarray(scores, dtype=float)
    interval = None
    if len(values) > 1:
        low, high = bootstrap_interval([values], interquartile_mean)
        interval = (float(low), float(high))
    return Summary(tuple(values.tolist()), float(values.mean()), float(interquartile_mean(values)), interval)


def interquartile_mean(scores: np.ndarray, axis: int = 0) -> np.ndarray:
    """Mean of the middle half along `axis`: `n // 4` scores are cut off at either end, so none of fewer than four."""
    ordered = np.moveaxis(np.sort(scores, axis=axis), axis, 0)
    cut = len(ordered) // 4
    return ordered[cut : len(ordered) - cut].mean(axis=0)


def bootstrap_interval(
    strata: Sequence[np.ndarray],
    statistic: Statistic,
    resamples: int = RESAMPLES,
    level: float = LEVEL,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """Percentile interval of a statistic of all scores, each stratum drawn anew from its own scores.

    Args:
        strata: scores [R_s, ...] of the runs of each stratum (in the paper a task: here a set of clips); what follows
            the first dimension is the same in all and is drawn together.
        statistic: of the drawn scores [resamples, sum R_s, ...] along axis 1.
        resamples: how often.
        level: share of the statistics within the interval.
        seed: of the draws.

    Returns:
        Lower and upper end [...].
    """
    generator = np.random.default_rng(seed)
    drawn = [stratum[generator.integers(len(stratum), size=(resamples, len(stratum)))] for stratum in strata]
    statistics = statistic(np.concatenate(drawn, axis=1), axis=1)
    outside = (1.0 - level) / 2.0
    low, high = np.quantile(statistics, (outside, 1.0 - outside), axis=0)
    return low, high
