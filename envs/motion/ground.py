"""Where a clip's body is above the ground, and how its soles move while they stand on it."""

from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray

from murmillo.envs.character import CONTROL_DT, Character
from murmillo.envs.geometry import geom_heights
from murmillo.envs.motion.clip import Clip
from murmillo.envs.rotations import quat_rotate

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
    soles = _soles(character)
    qpos = torch.from_numpy(clip.qpos.copy())
    pos_w, quat_w = character.forward_kinematics(qpos)
    points = (pos_w[:, soles.body] + quat_rotate(quat_w[:, soles.body], torch.from_numpy(soles.point))).numpy()
    height = points[..., 2] - soles.radius
    grounded = (height[1:] < GROUNDED) & (height[:-1] < GROUNDED)
    moved = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=-1) * clip.fps * CONTROL_DT
    model = character.model
    return Ground(
        bodies=tuple(character.bodies[body - 1] for body in model.geom_bodyid if body),  # body 0 is the ground
        height=geom_heights(character, qpos).numpy(),
        feet=tuple(character.bodies[body] for body in soles.body),
        slide=moved * grounded,
        sole_height=height,
    )


@dataclass(frozen=True)
class _Soles:
    """The P points that a character's feet stand on [m]: their bodies, places there [P, 3], and balls around them."""

    body: NDArray[np.int64]
    point: _Floats
    radius: _Floats


@lru_cache(maxsize=8)
def _soles(character: Character) -> _Soles:
    model = character.model
    feet = [geom for geom in range(model.ngeom) if model.body(int(model.geom_bodyid[geom])).name in character.feet]
    soles = [_sole(model, geom) for geom in feet]
    counts = [len(points) for points, _ in soles]
    return _Soles(
        body=np.repeat(model.geom_bodyid[feet].astype(np.int64) - 1, counts),
        point=np.concatenate([points for points, _ in soles]),
        radius=np.repeat([radius for _, radius in soles], counts),
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
