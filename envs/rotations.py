"""Rotations as torch functions. Quaternions [..., 4] are wxyz and of unit norm; leading shapes broadcast.

Where a function has a `dim`, components may lie along another dimension than the last: with poses side by side in
memory a hundred worlds cost half as much.
"""

import torch
from torch import Tensor


def quat_mul(a: Tensor, b: Tensor) -> Tensor:
    """Hamilton product [..., 4]: the rotation b followed by a."""
    aw, ax, ay, az = a.unbind(-1)
    bw, bx, by, bz = b.unbind(-1)
    return torch.stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        dim=-1,
    )


def quat_conj(q: Tensor) -> Tensor:
    """The inverse rotation [..., 4]."""
    return torch.cat((q[..., :1], -q[..., 1:]), dim=-1)


def quat_rotate(q: Tensor, v: Tensor, dim: int = -1) -> Tensor:
    """Rotate the vectors v [..., 3] by q [..., 4]."""
    w, xyz = q.split((1, 3), dim)
    xyz, v = torch.broadcast_tensors(xyz, v)
    t = 2.0 * torch.linalg.cross(xyz, v, dim=dim)
    return v + w * t + torch.linalg.cross(xyz, t, dim=dim)


def quat_rotate_inverse(q: Tensor, v: Tensor) -> Tensor:
    """Express the vectors v [..., 3] in the frame whose rotation is q [..., 4]."""
    return quat_rotate(quat_conj(q), v)


def quat_from_rotvec(v: Tensor) -> Tensor:
    """Exponential map: rotation vector [..., 3] [rad] to quaternion [..., 4]."""
    angle = v.norm(dim=-1, keepdim=True)
    return torch.cat((torch.cos(0.5 * angle), 0.5 * torch.sinc(angle / (2.0 * torch.pi)) * v), dim=-1)


def quat_to_rotvec(q: Tensor) -> Tensor:
    """Logarithm: quaternion [..., 4] to rotation vector [..., 3], its angle in [0, pi] [rad]."""
    q = torch.where(q[..., :1] < 0.0, -q, q)
    sine = q[..., 1:].norm(dim=-1, keepdim=True)
    angle = 2.0 * torch.atan2(sine, q[..., :1])
    # near the identity angle/sine -> 2; the guard keeps the quotient finite there
    return q[..., 1:] * torch.where(sine > 1e-8, angle / sine.clamp_min(1e-8), 2.0)


def slerp(a: Tensor, b: Tensor, t: Tensor) -> Tensor:
    """Interpolate a [..., 4] to b [..., 4] along the shorter arc; t [...] in [0, 1] broadcasts."""
    t = t.unsqueeze(-1)
    cosine = (a * b).sum(-1, keepdim=True)
    b = torch.where(cosine < 0.0, -b, b)
    angle = torch.acos(cosine.abs().clamp(max=1.0))
    sine = torch.sin(angle)
    small = sine < 1e-6
    sine = torch.where(small, torch.ones_like(sine), sine)
    weight_a = torch.where(small, 1.0 - t, torch.sin((1.0 - t) * angle) / sine)
    weight_b = torch.where(small, t, torch.sin(t * angle) / sine)
    q = weight_a * a + weight_b * b
    return q / q.norm(dim=-1, keepdim=True)


def heading(q: Tensor, dim: int = -1) -> Tensor:
    """Yaw [...] [rad]: direction of the rotated x axis in the ground plane."""
    w, x, y, z = q.unbind(dim)
    return torch.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))


def heading_quat(q: Tensor, dim: int = -1) -> Tensor:
    """The rotation about z [..., 4] by the heading of q."""
    half = 0.5 * heading(q, dim)
    zero = torch.zeros_like(half)
    return torch.stack((torch.cos(half), zero, zero, torch.sin(half)), dim)


def tan_norm(q: Tensor, dim: int = -1) -> Tensor:
    """Continuous 6-D code of a rotation [..., 6]: the rotated x axis, then the rotated z axis (ASE section 8.1)."""
    w, x, y, z = q.unbind(dim)
    xz, wy, yy = x * z, w * y, y * y
    half = (
        0.5 - torch.addcmul(yy, z, z),
        torch.addcmul(x * y, w, z),
        xz - wy,
        xz + wy,
        torch.addcmul(y * z, w, x, value=-1),
        0.5 - torch.addcmul(yy, x, x),
    )
    return 2.0 * torch.stack(half, dim)
