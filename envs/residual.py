"""Skeletal residual forces: help from outside at the joints, in units of a scale (C.ASE section 3.1)."""

from typing import Literal

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.physics import State
from murmillo.envs.rotations import heading_quat, quat_rotate

_UNASSISTED = ("sword", "shield")  # what is carried is no joint of the skeleton


class ResidualForces:
    """Maps residual actions to forces at the body origins, which are the joints."""

    def __init__(self, character: Character, scale: float, reward: Literal["sum", "mean"] = "sum") -> None:
        """`scale` [N] is the force of a component of 1; `reward` is the form of the regularising reward."""
        self.scale = scale
        self._total = torch.sum if reward == "sum" else torch.mean
        self._bodies = torch.tensor(
            character.body_ids(tuple(body for body in character.bodies if body not in _UNASSISTED))
        )
        self._num_bodies = len(character.bodies)

    @property
    def action_dim(self) -> int:
        """45: a 3-vector at each of 15 joints."""
        return 3 * len(self._bodies)

    def __call__(self, action: Tensor, state: State) -> Tensor:
        """Forces [N, B, 3] [N] in the world frame; action [N, 45] in the heading frame, clamped to [-1, 1]."""
        force_h = self.scale * action.clamp(-1.0, 1.0).unflatten(-1, (len(self._bodies), 3))
        force_w = torch.zeros(len(action), self._num_bodies, 3, dtype=action.dtype)
        force_w[:, self._bodies] = quat_rotate(heading_quat(state.qpos[:, None, 3:7]), force_h)
        return force_w

    def action_for(self, force_h: Tensor) -> Tensor:
        """The action [N, 45] of forces on all bodies [N, B, 3], in units of the scale and the heading frame."""
        return force_h[:, self._bodies].clamp(-1.0, 1.0).flatten(1)

    def reward(self, action: Tensor) -> Tensor:
        """r_f [N], 1 without any force: exp(-sum_j |xi_j|), or with the mean over the joints in place of the sum.

        The forces are in units of the scale; the paper names no unit. The mean is the published code's form, and lets
        fifteen times the force pass.
        """
        size = action.clamp(-1.0, 1.0).unflatten(-1, (len(self._bodies), 3)).norm(dim=-1)
        return torch.exp(-self._total(size, dim=-1))
