"""Coverage of clips and of transitions between them, counted by hand."""

import pytest
import torch

from murmillo.envs.errors import SuiteError
from murmillo.envs.metrics.coverage import coverage, filtered_coverage, frequencies, majority_clip
from murmillo.envs.metrics.transitions import source_and_destination, transition_coverage, transition_matrix


def test_the_majority_of_the_transitions_decides_and_the_lowest_clip_wins_a_tie() -> None:
    nearest = torch.tensor([[5, 1, 5, 2, 5], [3, 3, 0, 3, 0], [4, 2, 2, 4, 1]])
    assert majority_clip(nearest, 6).tolist() == [5, 3, 2]


def test_only_counted_transitions_vote() -> None:
    nearest = torch.tensor([[5, 1, 5, 2, 5], [3, 3, 0, 3, 0]])
    counted = torch.tensor([[False, True, True, True, False], [False, False, True, True, True]])
    assert majority_clip(nearest, 6, counted).tolist() == [1, 0]


def test_frequencies_by_hand() -> None:
    matched = torch.tensor([7, 0, 7, 3, 7])
    assert frequencies(matched, (0, 2, 3, 7)).tolist() == [1, 0, 1, 3]
    assert frequencies(matched.flip(0), (7, 3, 2, 0)).tolist() == [3, 1, 0, 1]


def test_coverage_is_the_share_of_distinct_clips() -> None:
    assert coverage(torch.tensor([7, 0, 7, 3, 7]), (0, 2, 3, 7)) == 0.75
    assert coverage(torch.tensor([2, 2]), (0, 2, 3, 7)) == 0.25


def test_filtered_coverage_by_hand_and_strictly() -> None:
    # N / K is 10, so that the rates ask for more than 0, 1, 2, 3, 4 and 5 matches
    matched = torch.tensor([0] * 1 + [1] * 4 + [2] * 5 + [3] * 30)
    rates = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
    assert [filtered_coverage(matched, range(4), rate) for rate in rates] == [1.0, 0.75, 0.75, 0.75, 0.5, 0.25]


def test_a_rate_is_the_decimal_that_is_written() -> None:
    assert 0.29 * 200 / 2 < 29
    matched = torch.tensor([0] * 29 + [1] * 171)
    assert filtered_coverage(matched, range(2), 0.29) == 0.5


def test_a_match_of_a_clip_that_does_not_count_is_an_error() -> None:
    with pytest.raises(SuiteError, match="clip 4 is matched but not among the 3 distinct clips"):
        frequencies(torch.tensor([1, 4, 2]), (0, 1, 2))


def test_the_switch_divides_the_transitions() -> None:
    nearest = torch.tensor([[4, 4, 7, 7], [7, 4, 4, 4], [1, 1, 1, 2]])
    source, destination = source_and_destination(nearest, torch.tensor([2, 1, 3]), 8)
    assert source.tolist() == [4, 7, 1]
    assert destination.tolist() == [7, 4, 2]


def test_transition_probabilities_by_hand() -> None:
    source, destination = torch.tensor([0, 0, 2, 0]), torch.tensor([2, 0, 5, 2])
    expected = torch.tensor([[1 / 3, 2 / 3, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]], dtype=torch.float64)
    torch.testing.assert_close(transition_matrix(source, destination, (0, 2, 5)), expected)
    assert transition_coverage(source, destination, (0, 2, 5)) == 3 / 9


def test_every_pair_covers_all_transitions_and_rows_sum_to_one() -> None:
    source, destination = torch.cartesian_prod(torch.arange(4), torch.arange(4)).repeat(3, 1).unbind(1)
    assert transition_coverage(source, destination, range(4)) == 1.0
    matrix = transition_matrix(source, destination, range(4))
    torch.testing.assert_close(matrix, torch.full((4, 4), 0.25, dtype=torch.float64))


def test_the_order_of_trajectories_and_clips_does_not_matter() -> None:
    generator = torch.Generator().manual_seed(0)
    source, destination = torch.randint(6, (2, 50), generator=generator)
    shuffle, order = torch.randperm(50, generator=generator), torch.randperm(6, generator=generator)
    matrix = transition_matrix(source, destination, range(6))
    shuffled = transition_matrix(source[shuffle], destination[shuffle], order.tolist())
    torch.testing.assert_close(shuffled, matrix[order][:, order])
    assert transition_coverage(source[shuffle], destination[shuffle], order.tolist()) == transition_coverage(
        source, destination, range(6)
    )
    for rate in (0.0, 0.3, 0.9):
        assert filtered_coverage(source[shuffle], order.tolist(), rate) == filtered_coverage(source, range(6), rate)
