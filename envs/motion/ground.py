"""Where a clip's body is above the ground, and how its soles move while they stand on it."""

from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray

from murmillo.envs.character import CONTROL_DT, Character
from murmillo.envs.motion.clip import Clip
from murmillo.envs.rotations import quat_mul, quat_rotate

_Floats = NDArray[np.float64]

GROUNDED = 0.005
"""[m] A point of a sole that is lower than this stands on the ground."""


@dataclass(frozen=True)
class Ground:
    """A clip against the plane z = 0.

    Attributes:
        bodies, height: names of the G geoms' bodies, and [F, G] height of each geom's lowest point [m].
        feet, slide: names of the P sole points' bodies, and [F - 1, P] how far each moves in a control step while it is
            grounded at both ends of a frame, else 0 [m].
        sole_height: [F, P] of the sole points [m].
    """

    bodies: tuple[str, ...]
    height: _Floats
    feet: tuple[str, ...]
    slide: _Floats
    sole_height: _Floats


def ground_of(clip: Clip, character: Character) -> Ground:
    """Kinematics of a clip's geoms and soles; the slide is per control step of 1/30 s, whatever the clip's rate."""
    shapes = _shapes(character)
    body_pos_w, body_quat_w = character.forward_kinematics(torch.from_numpy(clip.qpos.copy()))
    quat_w = quat_mul(body_quat_w[:, shapes.body], torch.from_numpy(shapes.quat))
    pos_w = body_pos_w[:, shapes.body] + quat_rotate(body_quat_w[:, shapes.body], torch.from_numpy(shapes.pos))
    # how far each geom's own axes point up: the last row of its rotation matrix
    up = torch.stack([quat_rotate(quat_w, axis)[..., 2] for axis in torch.eye(3, dtype=torch.float64)], dim=-1)
    sole_w = body_pos_w[:, shapes.sole_body] + quat_rotate(
        body_quat_w[:, shapes.sole_body], torch.from_numpy(shapes.sole)
    )
    points = sole_w.numpy()
    height = points[..., 2] - shapes.sole_radius
    grounded = (height[1:] < GROUNDED) & (height[:-1] < GROUNDED)
    moved = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=-1) * clip.fps * CONTROL_DT
    return Ground(
        bodies=tuple(character.bodies[body] for body in shapes.body),
        height=pos_w[..., 2].numpy() - _reach(shapes, up.numpy()),
        feet=tuple(character.bodies[body] for body in shapes.sole_body),
        slide=moved * grounded,
        sole_height=height,
    )


@dataclass(frozen=True)
class _Shapes:
    """The G geoms of a character in their bodies' frames, and the P points of its soles."""

    body: NDArray[np.int64]
    pos: _Floats
    quat: _Floats
    kind: NDArray[np.int64]
    size: _Floats
    sole_body: NDArray[np.int64]
    sole: _Floats
    sole_radius: _Floats


@lru_cache(maxsize=8)
def _shapes(character: Character) -> _Shapes:
    model = character.model
    geoms = np.flatnonzero(model.geom_bodyid)  # those of the world, body 0, are the ground
    feet = [geom for geom in geoms if character.bodies[model.geom_bodyid[geom] - 1] in character.feet]
    soles = [_sole(model, int(geom)) for geom in feet]
    counts = [len(points) for points, _ in soles]
    return _Shapes(
        body=model.geom_bodyid[geoms].astype(np.int64) - 1,
        pos=model.geom_pos[geoms].copy(),
        quat=model.geom_quat[geoms].copy(),
        kind=model.geom_type[geoms].astype(np.int64),
        size=model.geom_size[geoms].copy(),
        sole_body=np.repeat(model.geom_bodyid[feet].astype(np.int64) - 1, counts),
        sole=np.concatenate([points for points, _ in soles]),
        sole_radius=np.repeat([radius for _, radius in soles], counts),
    )


def _sole(model: mujoco.MjModel, geom: int) -> tuple[_Floats, float]:
    """Points [P, 3] in the body's frame that a foot's geom stands on, and the radius of the ball around each [m].

    Of a box they are the corners of the face that looks down in the zero pose; of others its ends.
    """
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    axes, size, radius = rotation.reshape(3, 3), model.geom_size[geom], 0.0
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
        down = int(np.abs(axes[2]).argmax())
        corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]) * size
        points = corners[corners[:, down] * axes[2, down] < 0.0]
    else:
        ends = (-1.0, 1.0) if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE else (0.0,)
        points, radius = np.array([[0.0, 0.0, end * size[1]] for end in ends]), float(size[0])
    return model.geom_pos[geom] + points @ axes.T, radius


def _reach(shapes: _Shapes, up: _Floats) -> _Floats:
    """How far each geom reaches below its centre [F, G] [m]; `up` [F, G, 3] are the heights of its axes' tips."""
    radius, half = shapes.size[:, 0], shapes.size[:, 1]
    reach = np.broadcast_to(radius, up.shape[:-1]).copy()  # a sphere
    box = shapes.kind == mujoco.mjtGeom.mjGEOM_BOX
    capsule = shapes.kind == mujoco.mjtGeom.mjGEOM_CAPSULE
    cylinder = shapes.kind == mujoco.mjtGeom.mjGEOM_CYLINDER
    reach[:, box] = np.sum(np.abs(up[:, box]) * shapes.size[box], axis=-1)
    reach[:, capsule] += half[capsule] * np.abs(up[:, capsule, 2])
    rim = radius[cylinder] * np.hypot(up[:, cylinder, 0], up[:, cylinder, 1])
    reach[:, cylinder] = rim + half[cylinder] * np.abs(up[:, cylinder, 2])
    return reach
