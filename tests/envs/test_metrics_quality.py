"""Slide, jerk, power and residual forces: by hand, and seen from anywhere."""

import math

import pytest
import torch

from murmillo.envs.metrics.quality import foot_slide, jerk, power, residual_share
from murmillo.envs.rotations import quat_from_rotvec, quat_rotate


def test_a_foot_slides_only_while_it_stands() -> None:
    foot = torch.zeros(4, 2, 3)
    foot[:, 0, 0] = torch.tensor([0.0, 0.03, 0.03, 5.0])  # slides 3 cm, stands, and is lifted: 0.9 m/s, 0
    foot[:, 1, 1] = torch.tensor([0.0, 1.0, 1.0, 1.04])  # lands, and slides 4 cm in the last step: 0, 1.2 m/s
    foot[:, 0, 2] = torch.tensor([0.0, 0.5, 0.5, 0.5])  # height is no slide
    touching = torch.tensor([[True, False], [True, True], [True, True], [False, True]])
    assert foot_slide(foot, touching) == pytest.approx((0.9 + 0.0 + 0.0 + 1.2) / 4)


def test_feet_that_never_stand_do_not_slide_and_those_that_stay_have_a_slide_of_0() -> None:
    assert foot_slide(torch.ones(5, 2, 3), torch.ones(5, 2, dtype=torch.bool)) == 0.0
    assert math.isnan(foot_slide(torch.zeros(5, 2, 3), torch.zeros(5, 2, dtype=torch.bool)))


def test_jerk_of_a_cubic_is_its_third_derivative() -> None:
    time = torch.arange(20).double() / 30
    pos = torch.stack((2.0 * time**3, time**2, 5.0 - time), dim=-1)[:, None]
    assert jerk(pos) == pytest.approx(12.0, rel=1e-6)
    assert jerk(pos[:, :, 1:]) == pytest.approx(0.0, abs=1e-6)


def test_slide_and_jerk_are_the_same_from_anywhere() -> None:
    generator = torch.Generator().manual_seed(0)
    pos = torch.randn(3, 10, 2, 3, generator=generator, dtype=torch.float64)
    touching = torch.rand(3, 10, 2, generator=generator) < 0.6
    turned = quat_rotate(quat_from_rotvec(torch.tensor([0.0, 0.0, 2.0]).double()), pos) + torch.tensor([5.0, -3.0, 0.0])
    assert foot_slide(turned, touching) == pytest.approx(foot_slide(pos, touching))
    assert jerk(turned) == pytest.approx(jerk(pos))
    assert foot_slide(pos.flip(0), touching.flip(0)) == pytest.approx(foot_slide(pos, touching))


def test_braking_turns_over_energy_too() -> None:
    torque, velocity = torch.tensor([[10.0, -4.0], [1.0, 1.0]]), torch.tensor([[2.0, 1.0], [0.0, -6.0]])
    assert power(torque, velocity) == pytest.approx(((20 + 4) + (0 + 6)) / 2)
    assert power(torque, torch.zeros_like(velocity)) == 0.0


def test_residual_share_by_hand() -> None:
    force = torch.tensor([[[0.3, 0.4, 0.0], [0.0, 0.0, 0.0]], [[0.0, 0.0, 1.0], [0.0, 2.0, 0.0]]])
    torque = torch.tensor([[3.0, 0.0, 4.0, -5.0], [0.0, 0.0, 0.0, 10.0]])
    joints = (slice(0, 3), slice(3, 4))
    assert residual_share(force, torque, joints) == pytest.approx((0.5 + 1.0 + 2.0) / (5 + 5 + 10))
    assert residual_share(torch.zeros_like(force), torque, joints) == 0.0
