"""Interquartile mean and bootstrap against cases that can be counted by hand."""

import numpy as np
import pytest

from murmillo.cli.comparison.statistics import bootstrap_interval, interquartile_mean, summarise


@pytest.mark.parametrize(
    ("scores", "expected"),
    [
        ([7.0], 7.0),
        ([1.0, 2.0, 6.0], 3.0),  # a quarter of three is less than one
        ([9.0, 2.0, 4.0, -50.0], 3.0),
        ([1000.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 1.0], 5.5),  # two are cut off at either end
    ],
)
def test_interquartile_mean(scores: list[float], expected: float) -> None:
    assert interquartile_mean(np.array(scores)) == expected


def test_interquartile_mean_reduces_the_axis_that_it_is_told() -> None:
    scores = np.array([[0.0, 1.0, 3.0, 100.0], [5.0, 5.0, 7.0, 7.0]])
    assert interquartile_mean(scores, axis=1).tolist() == [2.0, 6.0]
    assert interquartile_mean(scores, axis=0).tolist() == [2.5, 3.0, 5.0, 53.5]


def test_interval_of_scores_whose_draws_can_be_counted() -> None:
    # of the four draws, the number k of fours is binomial: P(k = 0) = 0.316, P(k = 4) = 0.004, P(k >= 3) = 0.051
    low, high = bootstrap_interval([np.array([0.0, 0.0, 0.0, 4.0])], np.mean)
    assert (low, high) == (0.0, 3.0)
    # P(k >= 2) = 0.262 and P(k >= 3) = 0.051 lie on either side of 0.1
    low, high = bootstrap_interval([np.array([0.0, 0.0, 0.0, 4.0])], np.mean, level=0.8)
    assert (low, high) == (0.0, 2.0)


def test_each_stratum_is_drawn_from_itself() -> None:
    """Strata without a spread of their own give an interval without width, however far they lie apart."""
    low, high = bootstrap_interval([np.zeros(3), np.full(3, 10.0)], np.mean)
    assert (low, high) == (5.0, 5.0)
    low, high = bootstrap_interval([np.array([0.0, 0.0, 0.0, 10.0, 10.0, 10.0])], np.mean)
    assert low < 2.0
    assert high > 8.0


def test_columns_are_drawn_together() -> None:
    scores = np.array([[0.0, 5.0], [1.0, 5.0], [2.0, 8.0]])
    low, high = bootstrap_interval([scores], np.mean)
    for column in range(2):
        alone = bootstrap_interval([scores[:, column]], np.mean)
        assert (low[column], high[column]) == alone


def test_summary() -> None:
    four = summarise([0.0, 0.4, 0.6, 0.8])
    assert four.mean == pytest.approx(0.45)
    assert four.iqm == pytest.approx(0.5)
    assert four.interval is not None
    assert 0.0 <= four.interval[0] < 0.5 < four.interval[1] <= 0.8
    assert summarise([0.0, 0.4, 0.6, 0.8]) == four
    one = summarise([0.3])
    assert (one.mean, one.iqm, one.interval) == (0.3, 0.3, None)
