"""The state that every policy and discriminator sees; one function for the simulation and for clips."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.rotations import heading_quat, quat_conj, quat_mul, quat_rotate, tan_norm


def state_dim(character: Character) -> int:
    """Width of `character_state`: 120 for the sword-and-shield humanoid."""
    return state_parts(character).keys.stop


def character_state(character: Character, qpos: Tensor, qvel: Tensor, key_pos_w: Tensor) -> Tensor:
    """The papers' state in the character's heading frame (ASE section 8.1), float32.

    The heading frame has its origin at the root and turns with the root's yaw alone.

    | columns | what                                                    | unit    |
    |---------|---------------------------------------------------------|---------|
    | 1       | height of the root above the ground                     | m       |
    | 6       | root rotation without its heading (tangent, normal)     | -       |
    | 3       | root linear velocity                                    | m/s     |
    | 3       | root angular velocity                                   | rad/s   |
    | 58      | joint rotations in MJCF order: 6 a ball, 1 a hinge      | - / rad |
    | 31      | joint velocities in the child's frame, in action order  | rad/s   |
    | 18      | right hand, left hand, right foot, left foot, sword tip, shield | m |

    Args:
        qpos: [..., nq] MuJoCo positions: root in the world, then joints.
        qvel: [..., nv] MuJoCo velocities: root linear in the world frame, root angular in the root's own frame, joints.
        key_pos_w: [..., K, 3] key points in the world [m].

    Returns:
        [..., 120] for the sword-and-shield humanoid.
    """
    layout = _layout(character, qpos.device)
    root_pos_w, root_quat_w = qpos[..., 0:3], qpos[..., 3:7]
    to_heading = quat_conj(heading_quat(root_quat_w))
    root_quat_h = quat_mul(to_heading, root_quat_w)
    key_pos_h = quat_rotate(to_heading.unsqueeze(-2), key_pos_w - root_pos_w.unsqueeze(-2))
    joints = qpos.new_empty(*qpos.shape[:-1], layout.width)
    joints[..., layout.ball_columns] = tan_norm(qpos[..., layout.ball_qpos])
    joints[..., layout.hinge_columns] = qpos[..., layout.hinge_qpos]
    parts = [
        root_pos_w[..., 2:3],
        tan_norm(root_quat_h),
        quat_rotate(to_heading, qvel[..., 0:3]),
        quat_rotate(root_quat_h, qvel[..., 3:6]),
        joints,
        qvel[..., 6:],
        key_pos_h.flatten(-2),
    ]
    return torch.cat(parts, dim=-1).float()


class StateParts(NamedTuple):
    """Where the parts of `character_state` lie: the rows of its table."""

    height: slice
    rotation: slice
    linear: slice
    angular: slice
    joints: slice
    joint_velocities: slice
    keys: slice


def state_parts(character: Character) -> StateParts:
    """The columns of each part of `character_state`."""
    rotations = sum(6 if joint.kind == "ball" else 1 for joint in character.joints)
    ends = list(accumulate((1, 6, 3, 3, rotations, character.action_dim, 3 * len(character.key_bodies))))
    return StateParts(*map(slice, [0, *ends[:-1]], ends))


def feature_mask(character: Character, masked: Collection[str]) -> Tensor:
    """Columns of `character_state` that tell of these key bodies.

    They are the bodies' key points, which C·ASE's adaptive masking leaves out, and the rotation and velocity of a joint
    whose body carries nothing else: without a sword, the wrist that would hold it has nothing to say either.

    Args:
        masked: names among `character.key_bodies`.

    Returns:
        [D] bool.
    """
    parts, idle = state_parts(character), idle_bodies(character, masked)
    mask = torch.zeros(state_dim(character), dtype=torch.bool)
    rotation, velocity = parts.joints.start, parts.joint_velocities.start
    for joint in character.joints:
        rotation_end = rotation + (6 if joint.kind == "ball" else 1)
        velocity_end = velocity + joint.dof.stop - joint.dof.start
        if character.bodies[int(character.model.joint(joint.name).bodyid[0]) - 1] in idle:
            mask[rotation:rotation_end] = mask[velocity:velocity_end] = True
        rotation, velocity = rotation_end, velocity_end
    mask[-3 * len(character.key_bodies) :] = torch.tensor(
        [body in masked for body in character.key_bodies]
    ).repeat_interleave(3)
    return mask


def idle_bodies(character: Character, masked: Collection[str]) -> tuple[str, ...]:
    """The bodies that carry nothing but these: how they are turned says nothing either."""
    model, idle = character.model, []
    for body, name in enumerate(character.bodies, start=1):
        carried = [model.body(child).name for child in range(model.nbody) if model.body_parentid[child] == body]
        if carried and all(child in masked for child in carried):
            idle.append(name)
    return tuple(idle)


@dataclass(frozen=True)
class _Layout:
    """Where the joints lie: `*_qpos` in qpos, `*_columns` among the `width` columns of joint rotations."""

    width: int
    ball_qpos: Tensor
    ball_columns: Tensor
    hinge_qpos: Tensor
    hinge_columns: Tensor


@lru_cache(maxsize=8)
def _layout(character: Character, device: torch.device) -> _Layout:
    column, ball, hinge = 0, [], []
    for joint in character.joints:
        if joint.kind == "ball":
            ball.append((range(joint.qpos.start, joint.qpos.stop), range(column, column + 6)))
            column += 6
        else:
            hinge.append((joint.qpos.start, column))
            column += 1
    ball_qpos, ball_columns = (torch.tensor([list(pair[i]) for pair in ball], device=device) for i in (0, 1))
    hinge_qpos, hinge_columns = torch.tensor(hinge, device=device).unbind(-1)
    return _Layout(column, ball_qpos, ball_columns, hinge_qpos, hinge_columns)
