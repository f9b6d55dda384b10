"""What tasks with props share: how a policy sees a prop, where props are put, how they are thrown and felt."""

import torch
from torch import Tensor

from murmillo.envs.devices import Placed
from murmillo.envs.physics import State
from murmillo.envs.rotations import heading_quat, quat_conj, quat_mul, quat_rotate, tan_norm
from murmillo.envs.tasks.goals import uniform

GRAVITY = 9.81
_UPRIGHT = Placed(torch.tensor([1.0, 0.0, 0.0, 0.0], dtype=torch.float64))


def seen(state: State, prop: int) -> Tensor:
    """[N, 15] a prop in the character's heading frame.

    Columns: place from the root [m] (3), rotation (6), linear velocity [m/s] (3), angular velocity [rad/s] (3).
    """
    pose, velocity = state.prop_qpos[:, prop], state.prop_qvel[:, prop]
    to_heading = quat_conj(heading_quat(state.qpos[:, 3:7]))
    place = quat_rotate(to_heading, pose[:, :3] - state.qpos[:, :3])
    quat = quat_mul(to_heading, pose[:, 3:7])
    linear, spin = quat_rotate(to_heading, velocity[:, :3]), quat_rotate(quat, velocity[:, 3:])
    return torch.cat((place, tan_norm(quat), linear, spin), dim=-1)


def felt(state: State, prop: int, bodies: Tensor, touch: float) -> Tensor:
    """[N] bool: the prop pressed on one of these bodies with more than `touch` along an axis [N]."""
    return (state.hit_force_w[:, prop].abs().amax(-1) > touch)[:, bodies].any(-1)


def around(centre_w: Tensor, distance: Tensor, generator: torch.Generator) -> Tensor:
    """Points [n, 2] at these distances [n] from centre_w [n, 2 or more] on the ground, in random directions [m]."""
    angle = uniform(len(distance), (-torch.pi, torch.pi), generator)
    return centre_w[:, :2] + distance.unsqueeze(-1) * torch.stack((angle.cos(), angle.sin()), dim=-1)


def put(state: State, env_ids: Tensor, prop: Tensor | int, pos_w: Tensor, quat_w: Tensor | None = None) -> None:
    """Place a prop [n] of these worlds [n] at pos_w [n, 3] with rotation quat_w [n, 4], else upright, at rest."""
    pose = state.prop_qpos
    pose[env_ids, prop, :3] = pos_w.to(pose)
    pose[env_ids, prop, 3:] = _UPRIGHT.like(pose) if quat_w is None else quat_w.to(pose)
    state.prop_qvel[env_ids, prop] = 0.0


def aimed(start_w: Tensor, target_w: Tensor, speed: tuple[float, float], generator: torch.Generator) -> Tensor:
    """Velocities [n, 3] [m/s] at which things thrown from start_w [n, 3] reach target_w [n, 3] [m].

    The speed along the straight line is drawn from the range; the fall on the way is made up for.
    """
    way_w = target_w - start_w
    time = way_w.norm(dim=-1).clamp_min(1e-6) / uniform(len(start_w), speed, generator)
    velocity = way_w / time.unsqueeze(-1)
    velocity[:, 2] += 0.5 * GRAVITY * time
    return velocity
