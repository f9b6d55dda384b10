"""How far the character's bodies reach down."""

from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.rotations import quat_mul, quat_rotate


def lowest_point(character: Character, qpos: Tensor) -> Tensor:
    """Height [...] [m] of the lowest point of any geom that can touch the ground, in the pose qpos [..., nq]."""
    return geom_heights(character, qpos).amin(-1)


def geom_heights(character: Character, qpos: Tensor) -> Tensor:
    """Heights [..., G] [m] of the lowest points of the bodies' G geoms, in the model's order, in the pose [..., nq]."""
    return geom_places(character, qpos)[1]


def geom_places(character: Character, qpos: Tensor) -> tuple[Tensor, Tensor]:
    """Centres [..., G, 3] of the bodies' geoms in the world, and heights [..., G] of their lowest points [m]."""
    pos, quat = character.forward_kinematics(qpos)
    geoms = _geoms(character, qpos.device)
    quat = quat[..., geoms.body, :]
    centre = pos[..., geoms.body, :] + quat_rotate(quat, geoms.pos.to(qpos))
    w, x, y, z = quat_mul(quat, geoms.quat.to(qpos)).unbind(-1)
    # heights of a geom's own axes: the lowest point is reached along them
    rise_x, rise_y = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x)
    rise_z = 1.0 - 2.0 * (x * x + y * y)
    radius, disc, half = geoms.radius.to(qpos), geoms.disc.to(qpos), geoms.half.to(qpos)
    along = half[:, 0] * rise_x.abs() + half[:, 1] * rise_y.abs() + half[:, 2] * rise_z.abs()
    across = disc * (1.0 - rise_z.square()).clamp_min(0.0).sqrt()
    return centre, centre[..., 2] - radius - along - across


@dataclass(frozen=True)
class _Geoms:
    """G geoms: their bodies and frames [G, 3], [G, 4] there, and what they reach.

    A ball of `radius` [G] is swept along the axes by `half` [G, 3] and over a disc of radius `disc` [G] across z [m].
    """

    body: Tensor
    pos: Tensor
    quat: Tensor
    radius: Tensor
    disc: Tensor
    half: Tensor


@lru_cache(maxsize=8)
def _geoms(character: Character, device: torch.device) -> _Geoms:
    model = character.model
    ids = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] > 0]
    radius, disc, half = (np.zeros(shape) for shape in (len(ids), len(ids), (len(ids), 3)))
    for i, geom in enumerate(ids):
        kind, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
        if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            radius[i] = size[0]
        elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            radius[i], half[i, 2] = size[0], size[1]
        elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            disc[i], half[i, 2] = size[0], size[1]
        elif kind == mujoco.mjtGeom.mjGEOM_BOX:
            half[i] = size
        else:
            raise NotImplementedError(f"geom {model.geom(geom).name}: no reach for {kind.name}")
    frames = (model.geom_pos[ids], model.geom_quat[ids])
    body = torch.tensor(model.geom_bodyid[ids] - 1, dtype=torch.int64, device=device)
    return _Geoms(body, *(torch.tensor(numbers, device=device) for numbers in (*frames, radius, disc, half)))
