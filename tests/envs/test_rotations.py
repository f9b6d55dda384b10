"""Rotations against MuJoCo's own functions and against identities."""

import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs import rotations as rot


@pytest.fixture
def quats() -> torch.Tensor:
    q = torch.randn(64, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    return q / q.norm(dim=-1, keepdim=True)


def test_product_and_rotation_agree_with_mujoco(quats):
    other, vectors = quats.flip(0), torch.randn(64, 3, dtype=torch.float64)
    product, rotated = np.empty(4), np.empty(3)
    for i in range(64):
        mujoco.mju_mulQuat(product, quats[i].numpy(), other[i].numpy())
        mujoco.mju_rotVecQuat(rotated, vectors[i].numpy(), quats[i].numpy())
        np.testing.assert_allclose(rot.quat_mul(quats[i], other[i]), product, atol=1e-12)
        np.testing.assert_allclose(rot.quat_rotate(quats[i], vectors[i]), rotated, atol=1e-12)
    torch.testing.assert_close(rot.quat_rotate_inverse(quats, rot.quat_rotate(quats, vectors)), vectors)


def test_logarithm_inverts_the_exponential_map_up_to_half_a_turn():
    direction = torch.tensor([0.6, 0.0, 0.8], dtype=torch.float64)
    for angle in (0.0, 1e-12, 1e-6, 0.3, 3.0, torch.pi - 1e-9):
        torch.testing.assert_close(rot.quat_to_rotvec(rot.quat_from_rotvec(angle * direction)), angle * direction)
    # beyond half a turn the shorter rotation comes back
    long_way = rot.quat_from_rotvec(4.0 * direction)
    torch.testing.assert_close(rot.quat_to_rotvec(long_way), (4.0 - 2 * torch.pi) * direction)


def test_slerp_moves_at_constant_speed_along_the_shorter_arc():
    a = rot.quat_from_rotvec(torch.tensor([0.0, 0.0, 0.2], dtype=torch.float64))
    b = rot.quat_from_rotvec(torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))
    for t, angle in ((0.0, 0.2), (0.25, 0.4), (1.0, 1.0)):
        for end in (b, -b):
            between = rot.slerp(a, end, torch.tensor(t, dtype=torch.float64))
            torch.testing.assert_close(rot.quat_to_rotvec(between)[2], torch.tensor(angle, dtype=torch.float64))


def test_heading_is_the_yaw_of_the_x_axis(quats):
    x = rot.quat_rotate(quats, torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64))
    torch.testing.assert_close(rot.heading(quats), torch.atan2(x[:, 1], x[:, 0]))
    without = rot.quat_mul(rot.quat_conj(rot.heading_quat(quats)), quats)
    torch.testing.assert_close(rot.heading(without), torch.zeros(64, dtype=torch.float64))


def test_tan_norm_holds_the_rotated_axes(quats):
    x, z = torch.eye(3, dtype=torch.float64)[[0, 2]]
    expected = torch.cat((rot.quat_rotate(quats, x.expand(64, 3)), rot.quat_rotate(quats, z.expand(64, 3))), dim=-1)
    torch.testing.assert_close(rot.tan_norm(quats), expected)
