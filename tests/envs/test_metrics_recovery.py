"""Falls and recoveries: each kind of trial by hand."""

import math

import pytest
import torch

from murmillo.envs.metrics.recovery import recovery

UP, LOW = (0.9, 1.4), (0.2, 0.3)


def trials(*rows: str) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Heights and touches of trials in letters: u up, U up but touching, l low, L low and touching, b bowed."""
    heights = {"u": UP, "U": UP, "l": LOW, "L": LOW, "b": (0.9, 0.9)}
    height = torch.tensor([[heights[letter] for letter in row] for row in rows])
    return height[..., 0], height[..., 1], torch.tensor([[letter in "UL" for letter in row] for row in rows])


def test_each_kind_of_trial() -> None:
    found = recovery(
        *trials(
            "uuuuuuuu",  # never fell
            "uuLLlbuu",  # four steps, for a bowed head is not yet up
            "uUuuuuuu",  # a hand breaks the stumble
            "uuLLLLLL",  # stays down
            "LuLLLLLL",  # up after one step, though not for long
        )
    )
    assert (found.trials, found.fell, found.standing) == (5, 4, 3)
    torch.testing.assert_close(found.time_s, torch.tensor([4.0, 0.0, 1.0]).double() / 30)
    assert found.share == pytest.approx(3 / 4)
    assert found.mean_s == pytest.approx(5 / 3 / 30)
    assert found.max_s == pytest.approx(4 / 30)


def test_low_without_a_touch_is_no_fall_and_upright_before_it_no_recovery() -> None:
    found = recovery(*trials("ulluuLLL"))
    assert (found.fell, len(found.time_s)) == (1, 0)
    assert found.share == 0.0
    assert math.isnan(found.mean_s)
    assert math.isnan(found.max_s)


def test_without_a_fall_there_is_no_share() -> None:
    found = recovery(*trials("uuu", "uuu"))
    assert found.fell == 0
    assert math.isnan(found.share)
