"""What is measured on a clip before it is fit to learn from."""

from dataclasses import dataclass

import mujoco
import numpy as np
import torch

from murmillo.envs.character import Character
from murmillo.envs.motion.authored.limits import BALL_LIMITS
from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.velocities import clip_velocities

GROUNDED = 0.005  # a corner of a sole lower than this stands on the ground [m]
HORIZON = 15  # control steps that open-loop targets are followed: 0.5 s
TRACKED = 0.15  # mean joint error that counts as followed [rad]


@dataclass(frozen=True)
class Measures:
    """Of one clip: the worst foot slide [m a frame], lowest point of a body [m], excess over the joint limits [rad],
    highest joint speed [rad/s], largest change of joint velocity between frames [rad/s], share of frames from which
    the open-loop targets are followed, and the distance between first and last pose [rad]."""

    slide: float
    lowest: float
    beyond_limits: float
    speed: float
    jump: float
    tracked: float
    closure: float


def measure(clip: Clip, character: Character, every: int = 1) -> Measures:
    """Measure a clip; tracking is tried from each `every`-th frame."""
    slide, lowest = _ground(clip.qpos, character.model)
    joints = character.joint_coordinates(torch.from_numpy(clip.qpos.copy())).numpy()
    speed = np.diff(joints, axis=0) * clip.fps
    rates = _velocities(clip, character)[:, 6:]
    error = tracking_error(clip, character, every)
    return Measures(
        slide=slide,
        lowest=lowest,
        beyond_limits=_beyond_limits(joints, character),
        speed=float(max(np.abs(rates).max(), np.abs(speed).max())),
        jump=float(np.abs(np.diff(speed, axis=0)).max()),
        tracked=float(np.mean(error < TRACKED)),
        closure=float(np.abs(joints[-1] - joints[0]).max()),
    )


def tracking_error(clip: Clip, character: Character, every: int = 1) -> np.ndarray:
    """Mean joint error [rad] over half a second of following the clip's next poses as PD targets, from sampled frames.

    Each start has the clip's pose and velocity; the error of a joint is the angle between its rotation and the clip's.
    """
    model = character.model
    data = mujoco.MjData(model)
    targets = character.joint_coordinates(torch.from_numpy(clip.qpos.copy())).numpy()
    qvel = _velocities(clip, character)
    errors = []
    for start in range(0, clip.frames - 1, every):
        mujoco.mj_resetData(model, data)
        data.qpos, data.qvel = clip.qpos[start], qvel[start]
        misses = []
        for frame in range(start + 1, min(start + HORIZON, clip.frames - 1) + 1):
            data.ctrl = targets[frame]
            mujoco.mj_step(model, data, character.substeps)
            misses.append(_joint_error(data.qpos, clip.qpos[frame], character).mean())
        errors.append(np.mean(misses))
    return np.array(errors)


def _velocities(clip: Clip, character: Character) -> np.ndarray:
    return clip_velocities(character, torch.from_numpy(clip.qpos.copy()), clip.fps).numpy()


def _joint_error(qpos: np.ndarray, wished: np.ndarray, character: Character) -> np.ndarray:
    """Angle between two poses [nq] at each joint [rad]."""
    errors = []
    for joint in character.joints:
        a, b = qpos[joint.qpos], wished[joint.qpos]
        ball = joint.kind == "ball"
        errors.append(2.0 * np.arccos(min(abs(float(a @ b)), 1.0)) if ball else abs(float(a[0] - b[0])))
    return np.array(errors)


def _ground(qpos: np.ndarray, model: mujoco.MjModel) -> tuple[float, float]:
    """Worst slide of a sole's corner between two frames in which it is grounded [m]; lowest point of any geom [m]."""
    data = mujoco.MjData(model)
    floor = model.geom("floor").id
    soles = [model.geom(f"{side}_foot").id for side in ("left", "right")]
    corners = np.array([[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    lowest, path = np.inf, []
    for pose in qpos:
        data.qpos = pose
        mujoco.mj_kinematics(model, data)
        heights = [_bottom(model, data, geom) for geom in range(model.ngeom) if geom != floor]
        lowest = min(lowest, *heights)
        path.append(
            [
                data.geom_xpos[sole] + (corners * model.geom_size[sole]) @ data.geom_xmat[sole].reshape(3, 3).T
                for sole in soles
            ]
        )
    points = np.array(path)
    grounded = (points[1:, ..., 2] < GROUNDED) & (points[:-1, ..., 2] < GROUNDED)
    moved = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=-1)
    return float(np.max(moved * grounded)), float(lowest)


def _bottom(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Height of the lowest point of a sphere, capsule, cylinder or box [m]."""
    up = data.geom_xmat[geom].reshape(3, 3)[2]
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        reach = np.abs(up) @ size
    elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        reach = size[0] * np.hypot(up[0], up[1]) + size[1] * abs(up[2])
    else:
        reach = size[0] + (size[1] * abs(up[2]) if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0)
    return float(data.geom_xpos[geom, 2] - reach)


def _beyond_limits(joints: np.ndarray, character: Character) -> float:
    """How far the worst joint coordinate [F, A] leaves its box, its range or the action's range [rad]."""
    low, high = (bound.copy() for bound in character.model.actuator_ctrlrange.T)
    for joint in character.joints:
        ball = joint.kind == "ball"
        box = np.radians(BALL_LIMITS[joint.name]) if ball else character.model.joint(joint.name).range[None]
        low[joint.action] = np.maximum(low[joint.action], box[:, 0])
        high[joint.action] = np.minimum(high[joint.action], box[:, 1])
    return float(np.maximum(low - joints, joints - high).max())
