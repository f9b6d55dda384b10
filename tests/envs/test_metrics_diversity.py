"""Average pairwise distance, its draws, and which skills are the most diverse."""

import math

import pytest
import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError
from murmillo.envs.metrics.diversity import average_pairwise_distance, most_diverse, repeated_distance, root_paths
from murmillo.envs.metrics.spread import Spread
from murmillo.envs.rotations import quat_from_rotvec, quat_mul, quat_rotate


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def by_definition(motion: Tensor) -> float:
    """Eq. 10 as it is written."""
    n, total = len(motion), 0.0
    for i in range(n):
        for j in range(n):
            if j != i:
                total += (motion[i] - motion[j]).double().norm(dim=-1).square().sum().sqrt().item()
    return total / (n * (n - 1))


def test_by_hand() -> None:
    motion = torch.tensor([[[0.0], [0.0]], [[3.0], [4.0]], [[3.0], [0.0]]])
    assert average_pairwise_distance(motion) == pytest.approx((5 + 3 + 4) / 3)


def test_blocks_agree_with_the_definition(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = 5.0 + normal(23, 6, 4)
    monkeypatch.setattr("murmillo.envs.metrics.diversity._BLOCK", 5)
    assert average_pairwise_distance(motion) == pytest.approx(by_definition(motion), rel=1e-5)


def test_one_motion_many_times_has_none() -> None:
    assert average_pairwise_distance((3.0 + normal(1, 30, 8)).expand(50, 30, 8)) == pytest.approx(0.0, abs=1e-4)


def test_neither_order_nor_threads_matter() -> None:
    motion, threads = normal(40, 6, 4), torch.get_num_threads()
    distance = average_pairwise_distance(motion)
    torch.set_num_threads(2)
    try:
        assert average_pairwise_distance(motion.flip(0)) == pytest.approx(distance, rel=1e-6)
    finally:
        torch.set_num_threads(threads)


def test_draws_share_no_motion() -> None:
    motion = torch.tensor([0.0, 1.0, 100.0, 104.0])[:, None, None]
    pairings = {(1, 4), (100, 103), (99, 104)}  # the two distances when the four are drawn in pairs
    for seed in range(10):
        spread = repeated_distance(motion, 2, 2, torch.Generator().manual_seed(seed))
        half = spread.deviation / math.sqrt(2)
        assert (round(spread.mean - half, 3), round(spread.mean + half, 3)) in pairings
        assert spread.count == 2


def test_draws_are_the_generators_alone() -> None:
    motion = normal(60, 4, 3)
    first, again, other = (repeated_distance(motion, 6, 10, torch.Generator().manual_seed(s)) for s in (0, 0, 1))
    assert first == again
    assert first.deviation != other.deviation


def test_too_few_motions_are_named() -> None:
    with pytest.raises(
        SuiteError, match="10 draws of 6 motions need 60: there are 50; record more or draw 5 at a time"
    ):
        repeated_distance(normal(50, 2, 2), 6, 10, torch.Generator())
    with pytest.raises(SuiteError, match="record two"):
        average_pairwise_distance(normal(1, 2, 2))


def test_spread_of_a_single_value_is_unknown() -> None:
    assert Spread.of(torch.tensor([1.0, 3.0])) == Spread(2.0, math.sqrt(2.0), 2)
    assert math.isnan(Spread.of(torch.tensor([1.0])).deviation)


def test_most_diverse_skills_come_first_and_equals_in_order() -> None:
    size = torch.tensor([1.0, 0.0, 5.0, 1.0, 2.0])
    offset = torch.tensor([0.0, 900.0, 0.0, 70.0, 0.0])  # where a skill goes does not make it diverse
    motion = normal(1, 12, 5, 2) * size[:, None, None, None] + offset[:, None, None, None]
    motion[3] = motion[0]
    assert most_diverse(motion, 4).tolist() == [2, 4, 0, 3]


def test_root_paths_start_at_the_origin_and_ahead_whatever_the_place_and_heading() -> None:
    forward = torch.tensor([[0.0, 0.0, 0.9], [1.0, 0.0, 0.8], [1.0, 2.0, 0.8]])
    tilted = quat_from_rotvec(torch.tensor([[0.0, 0.3, 0.0], [0.0, 0.0, 1.0], [0.2, 0.0, 0.0]]))
    yaw = quat_from_rotvec(torch.tensor([0.0, 0.0, 2.5]))
    moved = quat_rotate(yaw, forward) + torch.tensor([4.0, -7.0, 0.0])
    path = root_paths(torch.stack((forward, moved)), torch.stack((tilted, quat_mul(yaw, tilted))))
    assert path.shape == (2, 3, 2)
    torch.testing.assert_close(path, forward[:, :2].expand(2, 3, 2), atol=1e-5, rtol=0.0)
