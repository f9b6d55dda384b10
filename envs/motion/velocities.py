"""Velocities of recorded poses, as ASE's clips have them stored: the root's smoothed, the joints' not."""

import torch
from torch import Tensor
from torch.nn.functional import conv1d, pad

from murmillo.envs.character import Character
from murmillo.envs.rotations import quat_conj, quat_mul, quat_rotate_inverse, quat_to_rotvec

_SIGMA = 2.0
"""[frames] Width of the Gaussian over the root's velocities; cut at four sigma."""


def clip_velocities(character: Character, qpos: Tensor, fps: float) -> Tensor:
    """Finite differences of poses, in MuJoCo's layout.

    Root: central differences of the position and forward differences of the rotation (zero at the last frame, which
    has no next), each smoothed by a Gaussian of two frames. Joints: forward differences, unsmoothed, the last repeated.
    These are the conventions by which the velocities stored in the ASE clips were made.

    Args:
        qpos: [F, nq] poses, F >= 2.
        fps: frames a second [Hz].

    Returns:
        [F, nv]: root linear in the world [m/s], root angular in the root's frame [rad/s], ball joints in the child's
        frame and hinges [rad/s].
    """
    root_quat_w = qpos[:, 3:7]
    (linear_w,) = torch.gradient(qpos[:, 0:3], dim=0)
    turns_w = quat_to_rotvec(quat_mul(root_quat_w[1:], quat_conj(root_quat_w[:-1])))
    angular_w = torch.cat((turns_w, torch.zeros_like(turns_w[:1])))
    root = _smooth(torch.cat((linear_w, angular_w), dim=-1) * fps)
    joints = []
    for joint in character.joints:
        now, after = qpos[:-1, joint.qpos], qpos[1:, joint.qpos]
        step = quat_to_rotvec(quat_mul(quat_conj(now), after)) if joint.kind == "ball" else _wrap(after - now)
        joints.append(step * fps)
    joint = torch.cat(joints, dim=-1)
    joint = torch.cat((joint, joint[-1:]))
    return torch.cat((root[:, 0:3], quat_rotate_inverse(root_quat_w, root[:, 3:6]), joint), dim=-1)


def _smooth(values: Tensor) -> Tensor:
    """Gaussian over the frames of values [F, D]; the first and last frame continue beyond the ends."""
    radius = round(4.0 * _SIGMA)
    offsets = torch.arange(-radius, radius + 1, dtype=values.dtype, device=values.device)
    kernel = torch.exp(-0.5 * (offsets / _SIGMA) ** 2)
    extended = pad(values.T.unsqueeze(1), (radius, radius), mode="replicate")
    return conv1d(extended, (kernel / kernel.sum()).view(1, 1, -1)).squeeze(1).T


def _wrap(angle: Tensor) -> Tensor:
    """The same angle in [-pi, pi) [rad]."""
    return torch.remainder(angle + torch.pi, 2.0 * torch.pi) - torch.pi
