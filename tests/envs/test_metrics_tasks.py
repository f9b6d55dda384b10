"""Task figures and imitation error: by hand, aligned in time, and refusing what makes no sense."""

import itertools
import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from murmillo.envs.errors import SuiteError
from murmillo.envs.metrics.alignment import warping_path
from murmillo.envs.metrics.tasks import heading_cosine, imitation_error, normalised_return, reach_error
from murmillo.envs.rotations import quat_from_rotvec, quat_rotate


def motion(frames: int, pace: float = 1.0) -> Tensor:
    """Positions [frames, 4, 3] that never come back to where they were."""
    time = pace * torch.arange(frames).double()[:, None] + torch.arange(4)
    return torch.stack((0.1 * time, torch.sin(0.3 * time), torch.cos(0.2 * time)), dim=-1)


def test_return_between_its_bounds() -> None:
    reward = torch.tensor([[-1.0, -1.0], [3.0, 3.0], [1.0, 3.0]])
    found = normalised_return(reward, low=-1.0, high=3.0)
    assert found.mean == pytest.approx((0.0 + 1.0 + 0.75) / 3)
    assert found.count == 3
    with pytest.raises(SuiteError, match=r"rewards from -1 to 3 do not lie in \[0, 1\]; give the bounds"):
        normalised_return(reward, low=0.0, high=1.0)


def test_the_bounds_of_the_reward_are_0_and_1() -> None:
    for reward, expected in ((-0.3, 0.0), (0.9, 1.0)):
        found = normalised_return(torch.full((4, 7), reward), low=-0.3, high=0.9)
        assert (found.mean, found.deviation) == (pytest.approx(expected, abs=1e-6), pytest.approx(0.0, abs=1e-6))


def test_a_target_that_is_reached_is_no_error() -> None:
    found = reach_error(torch.ones(3, 5, 3), torch.ones(3, 5, 3))
    assert (found.mean, found.deviation, found.count) == (0.0, 0.0, 15)


def test_reach_error_by_hand() -> None:
    found = reach_error(
        torch.tensor([[0.3, 0.4, 1.0], [1.0, 1.0, 1.0]]), torch.tensor([[0.0, 0.0, 1.0], [1.0, 1.0, 2.0]])
    )
    assert (found.mean, found.deviation) == (pytest.approx(0.75), pytest.approx(0.5 / math.sqrt(2)))


def test_heading_cosine_by_hand() -> None:
    velocity = torch.tensor([[2.0, 0.0, 9.0], [0.0, 1.0, 0.0], [-3.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    direction = torch.tensor([5.0, 0.0]).expand(5, 2)
    assert heading_cosine(velocity, direction) == pytest.approx((1 + 0 - 1 + math.sqrt(0.5) + 0) / 5)
    turn = quat_from_rotvec(torch.tensor([0.0, 0.0, 1.1]))
    turned = quat_rotate(turn, torch.nn.functional.pad(direction, (0, 1)))
    assert heading_cosine(quat_rotate(turn, velocity), turned) == pytest.approx(heading_cosine(velocity, direction))


@given(st.integers(1, 5), st.integers(1, 5), st.integers(0, 999))
def test_no_path_is_cheaper(rows: int, columns: int, seed: int) -> None:
    cost = torch.randint(0, 9, (rows, columns), generator=torch.Generator().manual_seed(seed)).double()
    row, column = warping_path(cost)
    assert (row[0], column[0], row[-1], column[-1]) == (0, 0, rows - 1, columns - 1)
    for a, b in itertools.pairwise(zip(row.tolist(), column.tolist(), strict=True)):
        assert (b[0] - a[0], b[1] - a[1]) in {(0, 1), (1, 0), (1, 1)}

    def cheapest(i: int, j: int) -> float:
        before = [(i - 1, j), (i, j - 1), (i - 1, j - 1)]
        return cost[i, j].item() + min((cheapest(*cell) for cell in before if min(cell) >= 0), default=0.0)

    assert cost[row, column].sum().item() == cheapest(rows - 1, columns - 1)


def test_eq_15_by_hand() -> None:
    pos, reference = torch.zeros(2, 2, 3), torch.zeros(2, 2, 3)
    reference[0, 0] = torch.tensor([3.0, 4.0, 0.0])
    reference[1, 1, 2] = 1.0
    found = imitation_error(pos, reference, align=False)
    assert (found.mean, found.deviation) == (pytest.approx((2.5 + 0.5) / 2), pytest.approx(2.0 / math.sqrt(2)))


def test_a_delayed_copy_and_another_pace_are_no_error() -> None:
    reference = motion(30)
    delayed = torch.cat((reference[:1].expand(6, -1, -1), reference[:-6], reference[-6:]))
    assert imitation_error(delayed, reference).mean == 0.0
    assert imitation_error(reference.repeat_interleave(3, dim=0), reference).mean == 0.0
    assert imitation_error(delayed[:30], reference, align=False).mean > 0.3
    assert (
        imitation_error(motion(60, pace=0.5), reference).mean
        < 0.3 * imitation_error(motion(60, pace=0.5)[:30], reference, align=False).mean
    )


def test_waiting_in_a_pose_of_the_reference_is_an_error() -> None:
    reference = motion(30)
    assert imitation_error(reference[10:11].expand(30, -1, -1), reference).mean > 0.5


def test_a_constant_offset_is_the_error_with_and_without_alignment() -> None:
    reference = torch.zeros(8, 3, 3)
    pos = reference + torch.tensor([0.0, 0.06, 0.08])
    for align in (True, False):
        assert imitation_error(pos, reference, align).mean == pytest.approx(0.1)


def test_lengths_must_agree_only_without_alignment() -> None:
    with pytest.raises(SuiteError, match="20 frames against 30; cut them to one length or align"):
        imitation_error(motion(20), motion(30), align=False)
