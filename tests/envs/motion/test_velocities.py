"""Velocities of clips against hand-made motions and against MuJoCo's own differences."""

import math

import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs.motion.velocities import clip_velocities

FPS = 29.9


def test_joints_are_mujocos_differences(character, make_clip):
    qpos = make_clip(frames=12).qpos
    qvel = clip_velocities(character, torch.tensor(qpos), FPS).numpy()
    wanted = np.zeros_like(qvel[:-1])
    for i in range(11):
        mujoco.mj_differentiatePos(character.model, wanted[i], 1.0 / FPS, qpos[i], qpos[i + 1])
    np.testing.assert_allclose(qvel[:-1, 6:], wanted[:, 6:], atol=1e-9)
    assert np.array_equal(qvel[-1, 6:], qvel[-2, 6:])


def root_motion(character, frames, pos=None, quat=None):
    qpos = character.default_qpos.repeat(frames, 1)
    if pos is not None:
        qpos[:, 0:3] = pos
    if quat is not None:
        qpos[:, 3:7] = quat
    return qpos


def test_a_steady_walk(character):
    velocity = torch.tensor([1.0, -0.5, 0.1], dtype=torch.float64)
    pos = torch.arange(30, dtype=torch.float64).unsqueeze(-1) / FPS * velocity
    qvel = clip_velocities(character, root_motion(character, 30, pos), FPS)
    torch.testing.assert_close(qvel[:, 0:3], velocity.expand(30, 3))
    assert not qvel[:, 3:].any()


def test_a_jerk_is_spread_over_two_frames(character):
    """One step of 1 m between two frames: half of it in each one's central difference, then the Gaussian."""
    pos = torch.zeros(41, 3, dtype=torch.float64)
    pos[21:, 0] = 1.0
    qvel = clip_velocities(character, root_motion(character, 41, pos), FPS)
    weight = [math.exp(-0.5 * (k / 2.0) ** 2) for k in range(-8, 9)]
    peak = 0.5 * FPS * (weight[8] + weight[9]) / sum(weight)
    assert qvel[20, 0] == pytest.approx(peak, rel=1e-12)
    assert qvel[21, 0] == pytest.approx(peak, rel=1e-12)
    assert qvel[:, 0].sum() / FPS == pytest.approx(1.0, rel=1e-12)
    assert not qvel[:12, 0].any()


def test_a_spin_is_in_the_roots_own_frame(character):
    """A lying root that turns about the world's z turns about its own -x; half of the end is the missing next frame."""
    angle = 2.0 / FPS * torch.arange(30, dtype=torch.float64)
    half = 0.5 * angle
    # pitched by 90 degrees about y, then turned about z: q_z * q_y
    cosine = math.sqrt(0.5)
    quat = torch.stack((half.cos() * cosine, -half.sin() * cosine, half.cos() * cosine, half.sin() * cosine), dim=-1)
    qvel = clip_velocities(character, root_motion(character, 30, quat=quat), FPS)
    torch.testing.assert_close(qvel[:20, 3:6], torch.tensor([-2.0, 0.0, 0.0], dtype=torch.float64).expand(20, 3))
    assert qvel[29, 3] == pytest.approx(-2.0 * 0.4003, abs=2e-4)


def test_a_hinge_takes_the_short_way_round(character):
    knee = next(joint for joint in character.joints if joint.name == "right_knee")
    qpos = character.default_qpos.repeat(3, 1)
    qpos[:, knee.qpos] = torch.tensor([[3.1], [-3.1], [-3.0]], dtype=torch.float64)
    qvel = clip_velocities(character, qpos, 10.0)[:, knee.dof].squeeze(-1)
    torch.testing.assert_close(qvel, torch.tensor([(2 * math.pi - 6.2) * 10.0, 1.0, 1.0], dtype=torch.float64))
