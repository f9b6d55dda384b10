"""Forward kinematics of the character's tree of bodies: poses and velocities."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
import torch
from torch import Tensor

from murmillo.envs.devices import Placed
from murmillo.envs.rotations import quat_rotate

_FACTORS = torch.tensor([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
"""Which component of a stands beside component j of b in component i of the quaternion a b, `[i, j]`."""
_SIGNS = Placed(
    torch.tensor([[1, -1, -1, -1], [1, 1, -1, 1], [1, 1, 1, -1], [1, -1, 1, 1]], dtype=torch.float64)[..., None, None]
)
"""And with which sign, [4, 4, 1, 1]."""


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

    The frames are reckoned a level of the tree at a time, in few operations on all of its bodies: poses lie innermost
    in memory, and bodies in the order of their levels. A pose's frames do not depend on the poses beside it, to the
    last bit.
    """

    def __init__(self, model: mujoco.MjModel, joints: Sequence[Joint]) -> None:
        parents = (model.body_parentid[1:] - 1).tolist()
        self._size = len(parents)
        self._levels = _levels(parents)
        order = [0, *(body for level in self._levels for body in level.bodies)]
        place = [order.index(body) for body in range(self._size)]
        self._place = Placed(torch.tensor(place))
        self._carriers = Placed(torch.tensor([place[parents[body]] for body in order[1:]], dtype=torch.int64))
        self._offsets = Placed(torch.from_numpy(model.body_pos[1:][order[1:]].T.copy()).unsqueeze(-1))
        self._steps = [_Step.of(level, parents, place) for level in self._levels]

        balls = [joint for joint in joints if joint.kind == "ball"]
        hinges = [joint for joint in joints if joint.kind == "hinge"]
        self._ball_bodies = [_child(model, joint) for joint in balls]
        self._ball_dofs = _columns([joint.dof for joint in balls], 3)
        self._hinge_bodies = [_child(model, joint) for joint in hinges]
        self._hinge_dofs = [joint.dof.start for joint in hinges]
        self._hinge_columns = Placed(torch.tensor([joint.qpos.start for joint in hinges], dtype=torch.int64))
        axes = np.array([model.joint(joint.name).axis for joint in hinges]).reshape(-1, 3)
        self._hinge_axes = Placed(torch.from_numpy(axes))
        self._sources = Placed(torch.tensor(self._local_sources(model.nq, balls, hinges, order)))

    def __call__(self, qpos: Tensor) -> tuple[Tensor, Tensor]:
        """Body frames in the world of the pose qpos [..., nq]: positions [..., B, 3] [m], quaternions [..., B, 4]."""
        shape, device = qpos.shape[:-1], qpos.device
        columns = qpos.reshape(-1, qpos.shape[-1]).T.contiguous()  # [nq, n]
        quat = self._local_rotations(columns)  # [4, B, n], in the parent until the body's level is reached
        rows = quat.flatten(0, 1)
        for step in self._steps:
            product = rows.index_select(0, step.factors.on(device)).unflatten(0, (4, 4, step.size))
            product.mul_(_SIGNS.like(qpos)).mul_(quat[:, step.own])
            torch.sum(product, dim=1, out=quat[:, step.own])

        w, x = quat.index_select(1, self._carriers.on(device)).split([1, 3])
        offset = self._offsets.like(qpos)
        twice = 2.0 * torch.linalg.cross(x, offset.expand_as(x), dim=0)
        carried = torch.addcmul(offset, w, twice).add_(torch.linalg.cross(x, twice, dim=0))
        pos = columns.new_empty(3, self._size, columns.shape[-1])
        pos[:, 0] = columns[0:3]
        for step in self._steps:
            pos[:, step.own] = pos.index_select(1, step.parents.on(device)).add_(carried[:, step.carried])

        place = self._place.on(device)
        pos, quat = (part.index_select(1, place).permute(2, 1, 0) for part in (pos, quat))
        return pos.reshape(*shape, self._size, 3), quat.reshape(*shape, self._size, 4)

    def velocities(self, pos_w: Tensor, quat_w: Tensor, qvel: Tensor) -> tuple[Tensor, Tensor]:
        """Velocities of the body frames in the world, linear [..., B, 3] [m/s] and angular [..., B, 3] [rad/s].

        Args:
            pos_w, quat_w: [..., B, 3], [..., B, 4] the body frames.
            qvel: [..., nv] in MuJoCo's layout, root linear in the world and all else in the moved body's own frame.
        """
        spin = qvel.new_zeros(*qvel.shape[:-1], self._size, 3)  # of each body in its parent, in its own frame
        spin[..., 0, :] = qvel[..., 3:6]
        spin[..., self._ball_bodies, :] = qvel[..., self._ball_dofs]
        spin[..., self._hinge_bodies, :] = qvel[..., self._hinge_dofs].unsqueeze(-1) * self._hinge_axes.like(qvel)
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
        half = 0.5 * columns.index_select(0, self._hinge_columns.on(columns.device))
        axes = self._hinge_axes.like(columns).unsqueeze(-1)
        turned = (half.sin().unsqueeze(1) * axes).flatten(0, 1)
        unit = columns.new_tensor([[1.0], [0.0]]).expand(-1, columns.shape[-1])
        sources = torch.cat((columns, half.cos(), turned, unit))
        return sources.index_select(0, self._sources.on(columns.device)).unflatten(0, (4, self._size))

    def _local_sources(
        self, nq: int, balls: Sequence[Joint], hinges: Sequence[Joint], order: Sequence[int]
    ) -> list[int]:
        """[4 B] which row each component of a local rotation is: of the pose, hinges' cosines, their sines, 1 and 0."""
        one = nq + 4 * len(hinges)
        quats = {0: [3, 4, 5, 6]}
        for body, joint in zip(self._ball_bodies, balls, strict=True):
            quats[body] = list(range(joint.qpos.start, joint.qpos.stop))
        for i, body in enumerate(self._hinge_bodies):
            sine = nq + len(hinges) + 3 * i
            quats[body] = [nq + i, sine, sine + 1, sine + 2]
        unturned = [one, one + 1, one + 1, one + 1]
        return [quats.get(body, unturned)[component] for component in range(4) for body in order]


@dataclass(frozen=True)
class _Level:
    """Bodies at one depth of the tree and their parents, in MJCF order."""

    bodies: list[int]
    parents: list[int]


@dataclass(frozen=True)
class _Step:
    """What a level is reckoned from; here bodies are counted in the order of their levels.

    Attributes:
        own: its b bodies; carried: the same among all but the root.
        parents: [b] theirs.
        factors: [16 b] rows among [4 B] of their parents' components that its own four are products of.
    """

    own: slice
    carried: slice
    parents: Placed
    factors: Placed

    @property
    def size(self) -> int:
        """b."""
        return self.own.stop - self.own.start

    @classmethod
    def of(cls, level: _Level, parents: Sequence[int], place: Sequence[int]) -> "_Step":
        """The step of a level, whose bodies lie one behind the other."""
        own = slice(place[level.bodies[0]], place[level.bodies[-1]] + 1)
        above = torch.tensor([place[parents[body]] for body in level.bodies])
        factors = (len(place) * _FACTORS.unsqueeze(-1) + above).flatten()
        return cls(own, slice(own.start - 1, own.stop - 1), Placed(above), Placed(factors))


def _levels(parents: list[int]) -> list[_Level]:
    """The bodies after the root by their depth in the tree."""
    levels, placed = [], [0]
    while len(placed) < len(parents):
        bodies = [body for body in range(1, len(parents)) if body not in placed and parents[body] in placed]
        levels.append(_Level(bodies, [parents[body] for body in bodies]))
        placed += bodies
    return levels


def _columns(slices: Sequence[slice], width: int) -> Tensor:
    """[J, width] the columns of each slice."""
    return torch.tensor([list(range(s.start, s.stop)) for s in slices], dtype=torch.int64).reshape(-1, width)


def _child(model: mujoco.MjModel, joint: Joint) -> int:
    """Position among the bodies, without the world, of the one that the joint moves."""
    return int(model.joint(joint.name).bodyid[0]) - 1
