"""How far the character's bodies reach down."""

import mujoco
import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.rotations import quat_mul, quat_rotate

_SPHERE, _CAPSULE, _CYLINDER, _BOX = (
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_BOX,
)


def lowest_point(character: Character, qpos: Tensor) -> Tensor:
    """Height [...] [m] of the lowest point of any geom that can touch the ground, in the pose qpos [..., nq]."""
    pos, quat = character.forward_kinematics(qpos)
    model = character.model
    lows = []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom]) - 1
        if body < 0:
            continue
        offset, rotation = (torch.from_numpy(x[geom].copy()).to(qpos) for x in (model.geom_pos, model.geom_quat))
        centre = pos[..., body, 2] + quat_rotate(quat[..., body, :], offset)[..., 2]
        lows.append(centre - _reach(model, geom, quat_mul(quat[..., body, :], rotation)))
    return torch.stack(lows, dim=-1).amin(-1)


def _reach(model: mujoco.MjModel, geom: int, quat: Tensor) -> Tensor:
    """How far [...] [m] a geom with rotation quat [..., 4] reaches below its centre."""
    kind, size = model.geom_type[geom], torch.from_numpy(model.geom_size[geom].copy()).to(quat)
    # the height of the geom's own x, y and z axes; a point of the geom is a combination of them
    rise = torch.stack([quat_rotate(quat, axis)[..., 2] for axis in torch.eye(3).to(quat)], dim=-1).abs()
    if kind == _SPHERE:
        return size[0].expand(quat.shape[:-1])
    if kind == _CAPSULE:
        return size[0] + size[1] * rise[..., 2]
    if kind == _CYLINDER:
        return size[0] * (1.0 - rise[..., 2] ** 2).clamp_min(0.0).sqrt() + size[1] * rise[..., 2]
    if kind == _BOX:
        return (size * rise).sum(-1)
    raise NotImplementedError(f"geom {model.geom(geom).name}: no reach for {mujoco.mjtGeom(kind).name}")
