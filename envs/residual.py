"""Skeletal residual forces: help from outside at the joints, in units of a scale (C.ASE section 4.2)."""

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.physics import State
from murmillo.envs.rotations import heading_quat, quat_rotate

_UNASSISTED = ("sword", "shield")  # what is carried is no joint of the skeleton


class ResidualForces:
    """Maps residual actions to forces at the body origins, which are the joints."""

    def __init__(self, character: Character, scale: float) -> None:
        """`scale` [N] is the force of a component of 1."""
        self.scale = scale
        self._bodies = character.body_ids(tuple(body for body in character.bodies if body not in _UNASSISTED))
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
