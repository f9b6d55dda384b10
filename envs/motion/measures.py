"""What is measured on a clip before it is fit to learn from."""

from dataclasses import dataclass
from math import ceil

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray

from murmillo.envs.character import Character
from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.editing import poses_at
from murmillo.envs.motion.ground import ground_of
from murmillo.envs.motion.velocities import clip_velocities
from murmillo.envs.rotations import quat_conj, quat_mul, quat_to_rotvec

_Floats = NDArray[np.float64]

HORIZON = 15  # control steps that open-loop targets are followed: 0.5 s
TRACKED = 0.15  # mean joint error that counts as followed [rad]


@dataclass(frozen=True)
class Measures:
    """Of one clip: the worst slide of a standing sole [m a control step], lowest point of a body [m], excess over the
    joint limits [rad], highest joint speed [rad/s], largest change of joint velocity between frames [rad/s], share of
    frames from which the open-loop targets are followed (NaN where that was not tried), and the largest angle by which
    a joint of the last pose differs from the first [rad]."""

    slide: float
    lowest: float
    beyond_limits: float
    speed: float
    jump: float
    tracked: float
    closure: float


def measure(clip: Clip, character: Character, every: int | None = 1) -> Measures:
    """Measure a clip; tracking, which simulates and so is slow, is tried from each `every`-th frame, or not at all."""
    ground = ground_of(clip, character)
    rates = velocities(clip, character)[:-1, 6:]  # the last row repeats the one before
    tracked = float("nan") if every is None else float(np.mean(tracking_error(clip, character, every) < TRACKED))
    return Measures(
        slide=float(ground.slide.max()),
        lowest=float(ground.height.min()),
        beyond_limits=float(beyond_limits(joint_coordinates(clip, character), character).max()),
        speed=float(np.abs(rates).max()),
        jump=float(np.abs(np.diff(rates, axis=0)).max(initial=0.0)),
        tracked=tracked,
        closure=float(_joint_error(clip.qpos[-1:], clip.qpos[:1], character).max()),
    )


def joint_coordinates(clip: Clip, character: Character) -> _Floats:
    """The clip's exponential maps and angles [F, A] [rad]."""
    return character.joint_coordinates(torch.from_numpy(clip.qpos.copy())).numpy()


def velocities(clip: Clip, character: Character) -> _Floats:
    """The clip's velocities [F, nv], as `clip_velocities` has them."""
    return clip_velocities(character, torch.from_numpy(clip.qpos.copy()), clip.fps).numpy()


def beyond_limits(joints: _Floats, character: Character) -> _Floats:
    """How far joint coordinates [F, A] leave their box, their range or the action's range [rad]; negative inside.

    Of the two rotation vectors of a ball joint, with angles a and 2 pi - a, the one nearer to its box counts: an arm
    that passes behind the vertical would else seem to leap from one end of its box beyond the other.
    """
    (low, high), (lowest, highest) = character.joint_limits.numpy().T, character.model.actuator_ctrlrange.T
    low, high = np.maximum(low, lowest), np.minimum(high, highest)
    excess = np.maximum(low - joints, joints - high)
    for joint in character.joints:
        if joint.kind == "ball":
            columns = joint.action
            angle = np.linalg.norm(joints[:, columns], axis=1, keepdims=True)
            other = joints[:, columns] * (1.0 - 2.0 * np.pi / np.maximum(angle, 1e-9))
            of_other = np.maximum(low[columns] - other, other - high[columns])
            nearer = of_other.max(axis=1) < excess[:, columns].max(axis=1)
            excess[nearer, columns] = of_other[nearer]
    return excess


def tracking_error(clip: Clip, character: Character, every: int = 1) -> _Floats:
    """Mean joint error [rad] over half a second of following the clip's next poses as PD targets, from sampled frames.

    Each start has the clip's pose and velocity; targets are a control step apart, whatever the clip's rate. The error
    of a joint is the angle between its rotation and the clip's.
    """
    model = character.model
    data = mujoco.MjData(model)
    qvel = velocities(clip, character)
    step = clip.fps * character.control_dt  # [frames]
    errors = []
    for start in range(0, max(1, clip.frames - ceil(step - 1e-6)), every):
        mujoco.mj_resetData(model, data)
        data.qpos, data.qvel = clip.qpos[start], qvel[start]
        steps = min(HORIZON, max(1, int((clip.frames - 1 - start) / step + 1e-6)))
        ahead = np.minimum(start + step * np.arange(1, steps + 1), clip.frames - 1)
        wished = poses_at(clip, ahead, character)
        reached = []
        for target in character.joint_coordinates(torch.from_numpy(wished)).numpy():
            data.ctrl = target
            mujoco.mj_step(model, data, character.substeps)
            reached.append(data.qpos.copy())
        errors.append(_joint_error(np.stack(reached), wished, character).mean())
    return np.array(errors)


def _joint_error(qpos: _Floats, wished: _Floats, character: Character) -> _Floats:
    """Angle between poses [F, nq] at each joint [F, J] [rad]."""
    a, b = torch.tensor(qpos), torch.tensor(wished)
    errors = [
        quat_to_rotvec(quat_mul(quat_conj(a[:, joint.qpos]), b[:, joint.qpos])).norm(dim=-1)
        if joint.kind == "ball"
        else (a[:, joint.qpos] - b[:, joint.qpos]).abs().squeeze(-1)
        for joint in character.joints
    ]
    return torch.stack(errors, dim=-1).numpy()
