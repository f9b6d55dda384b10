"""The state that every policy and discriminator sees; one function for the simulation and for clips."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.rotations import heading, quat_rotate, tan_norm


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
    # poses side by side in memory, and few operations on much: a hundred worlds cost half as much so
    pose, speed, key_pos_w = (_rows(part) for part in (qpos, qvel, key_pos_w.flatten(-2)))
    root_quat_w = pose[3:7]
    yaw = heading(root_quat_w, dim=0)
    turned_back = layout.signs * root_quat_w.flip(0)
    root_quat_h = (0.5 * yaw).cos() * root_quat_w + (0.5 * yaw).sin() * turned_back
    quats = torch.cat((root_quat_h, pose.index_select(0, layout.balls))).unflatten(0, (-1, 4))
    vectors_w = torch.cat((key_pos_w.unflatten(0, (-1, 3)) - pose[0:3], speed[None, 0:3]))
    (x, y, up), cosine, sine = vectors_w.unbind(1), yaw.cos(), yaw.sin()
    parts = [
        pose,
        speed,
        tan_norm(quats, dim=1).flatten(0, 1),
        torch.addcmul(cosine * x, sine, y),
        torch.addcmul(cosine * y, sine, x, value=-1),
        up,
        quat_rotate(root_quat_h, speed[3:6], dim=0),
    ]
    columns = torch.cat(parts).index_select(0, layout.columns).float()
    return columns.T.reshape(*qpos.shape[:-1], len(columns))


def _rows(part: Tensor) -> Tensor:
    """[d, n] of [..., d]."""
    return part.reshape(-1, part.shape[-1]).T.contiguous()


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
    """Where `character_state` finds what it is made of.

    Attributes:
        balls: [4 J] rows of the ball joints' quaternions in qpos.
        columns: [D] its columns, as rows of all that it reckons.
        signs: [4, 1] that make the product of a flipped quaternion (z, y, x, w) with the z axis.
    """

    balls: Tensor
    columns: Tensor
    signs: Tensor


@lru_cache(maxsize=8)
def _layout(character: Character, device: torch.device) -> _Layout:
    """The rows are qpos, qvel, six of the root and of each ball joint, and x, y, z of key points, velocity and spin."""
    model, keys = character.model, len(character.key_bodies)
    rotations = model.nq + model.nv
    balls, joints, row = list[int](), list[int](), rotations + 6
    for joint in character.joints:
        if joint.kind == "ball":
            balls += range(joint.qpos.start, joint.qpos.stop)
            joints += range(row, row + 6)
            row += 6
        else:
            joints.append(joint.qpos.start)
    *points, velocity = [[row + axis * (keys + 1) + i for axis in range(3)] for i in range(keys + 1)]
    spin = row + 3 * (keys + 1)
    columns = [2, *range(rotations, rotations + 6), *velocity, *range(spin, spin + 3), *joints]
    columns += [*range(model.nq + 6, model.nq + model.nv), *(axis for point in points for axis in point)]
    return _Layout(
        torch.tensor(balls, dtype=torch.int64, device=device),
        torch.tensor(columns, device=device),
        torch.tensor([[1.0], [1.0], [-1.0], [-1.0]], device=device),
    )
