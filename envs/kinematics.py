"""Forward kinematics of the character's tree of bodies: poses and velocities."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
import torch
from torch import Tensor

from murmillo.envs.rotations import components_mul, components_rotate, quat_rotate


@dataclass(frozen=True)
class Joint:
    """A joint and where it lies in qpos, in qvel and in the action."""

    name: str
    kind: Literal["ball", "hinge"]
    qpos: slice
    dof: slice
    action: slice


class BodyTree:
    """Bodies on a free root, each but the root on one ball or hinge joint at most, at a fixed offset in its parent.

    The frames are reckoned a level of the tree at a time, with each component of the vectors and quaternions of all
    bodies and poses side by side in memory; that is three times as fast as pose by pose.
    """

    def __init__(self, model: mujoco.MjModel, joints: Sequence[Joint]) -> None:
        parents = model.body_parentid[1:] - 1
        self._size = len(parents)
        self._levels = _levels(parents.tolist(), torch.from_numpy(model.body_pos[1:].copy()))
        balls = [joint for joint in joints if joint.kind == "ball"]
        hinges = [joint for joint in joints if joint.kind == "hinge"]
        self._ball_bodies = [_child(model, joint) for joint in balls]
        self._ball_columns = _columns([joint.qpos for joint in balls], 4)
        self._ball_dofs = _columns([joint.dof for joint in balls], 3)
        self._hinge_bodies = [_child(model, joint) for joint in hinges]
        self._hinge_columns = [joint.qpos.start for joint in hinges]
        self._hinge_dofs = [joint.dof.start for joint in hinges]
        axes = np.array([model.joint(joint.name).axis for joint in hinges])
        self._hinge_axes = torch.from_numpy(axes.reshape(-1, 3))

    def __call__(self, qpos: Tensor) -> tuple[Tensor, Tensor]:
        """Body frames in the world of the pose qpos [..., nq]: positions [..., B, 3] [m], quaternions [..., B, 4]."""
        shape = qpos.shape[:-1]
        columns = qpos.reshape(-1, qpos.shape[-1]).T.contiguous()  # [nq, n]
        quat = self._local_rotations(columns)  # [4, B, n], in the parent until the body's level is reached
        pos = columns.new_empty(3, self._size, columns.shape[-1])
        pos[:, 0] = columns[0:3]
        for level in self._levels:
            parent = quat[:, level.parents].unbind(0)
            offset = level.offsets.to(qpos).unsqueeze(-1).unbind(0)
            pos[:, level.bodies] = pos[:, level.parents] + torch.stack(components_rotate(parent, offset))
            quat[:, level.bodies] = torch.stack(components_mul(parent, quat[:, level.bodies].unbind(0)))
        return pos.permute(2, 1, 0).reshape(*shape, self._size, 3), quat.permute(2, 1, 0).reshape(*shape, self._size, 4)

    def velocities(self, pos_w: Tensor, quat_w: Tensor, qvel: Tensor) -> tuple[Tensor, Tensor]:
        """Velocities of the body frames in the world, linear [..., B, 3] [m/s] and angular [..., B, 3] [rad/s].

        Args:
            pos_w, quat_w: [..., B, 3], [..., B, 4] the body frames.
            qvel: [..., nv] in MuJoCo's layout, root linear in the world and all else in the moved body's own frame.
        """
        spin = qvel.new_zeros(*qvel.shape[:-1], self._size, 3)  # of each body in its parent, in its own frame
        spin[..., 0, :] = qvel[..., 3:6]
        spin[..., self._ball_bodies, :] = qvel[..., self._ball_dofs]
        spin[..., self._hinge_bodies, :] = qvel[..., self._hinge_dofs].unsqueeze(-1) * self._hinge_axes.to(qvel)
        angular, linear = quat_rotate(quat_w, spin), torch.empty_like(pos_w)
        linear[..., 0, :] = qvel[..., 0:3]
        for level in self._levels:
            carried = angular[..., level.parents, :]
            arm = pos_w[..., level.bodies, :] - pos_w[..., level.parents, :]
            linear[..., level.bodies, :] = linear[..., level.parents, :] + torch.linalg.cross(carried, arm)
            angular[..., level.bodies, :] += carried
        return linear, angular

    def _local_rotations(self, columns: Tensor) -> Tensor:
        """Rotation of each body in its parent [4, B, n], the root's in the world, of poses [nq, n]."""
        quat = columns.new_zeros(4, self._size, columns.shape[-1])
        quat[0] = 1.0
        quat[:, 0] = columns[3:7]
        quat[:, self._ball_bodies] = columns[self._ball_columns.T]
        half = 0.5 * columns[self._hinge_columns]
        quat[0, self._hinge_bodies] = half.cos()
        quat[1:, self._hinge_bodies] = half.sin() * self._hinge_axes.to(columns).T.unsqueeze(-1)
        return quat


@dataclass(frozen=True)
class _Level:
    """Bodies at one depth of the tree, their parents, and their offsets [3, b] [m] there."""

    bodies: list[int]
    parents: list[int]
    offsets: Tensor


def _levels(parents: list[int], offsets: Tensor) -> list[_Level]:
    """The bodies after the root by their depth in the tree."""
    levels, placed = [], [0]
    while len(placed) < len(parents):
        bodies = [body for body in range(1, len(parents)) if body not in placed and parents[body] in placed]
        levels.append(_Level(bodies, [parents[body] for body in bodies], offsets[bodies].T))
        placed += bodies
    return levels


def _columns(slices: Sequence[slice], width: int) -> Tensor:
    """[J, width] the columns of each slice."""
    return torch.tensor([list(range(s.start, s.stop)) for s in slices], dtype=torch.int64).reshape(-1, width)


def _child(model: mujoco.MjModel, joint: Joint) -> int:
    """Position among the bodies, without the world, of the one that the joint moves."""
    return int(model.joint(joint.name).bodyid[0]) - 1
