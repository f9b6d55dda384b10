"""Rotations as numpy functions. Quaternions [..., 4] are wxyz and of unit norm; leading shapes broadcast.

The simulation's own (envs/rotations.py) work on torch tensors; reading a file needs no torch.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Floats = NDArray[np.float64]

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def multiply(a: _Floats, b: _Floats) -> _Floats:
    """Hamilton product [..., 4]: the rotation b followed by a."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def conjugate(q: _Floats) -> _Floats:
    """The inverse rotation [..., 4]."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: _Floats, v: _Floats) -> _Floats:
    """The vectors v [..., 3] turned by q [..., 4]."""
    w, xyz = q[..., :1], q[..., 1:]
    t = 2.0 * np.cross(xyz, v)
    return v + w * t + np.cross(xyz, t)


def from_rotvec(v: _Floats) -> _Floats:
    """Exponential map: rotation vector [..., 3] [rad] to quaternion [..., 4]."""
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(0.5 * angle), 0.5 * np.sinc(angle / (2.0 * np.pi)) * v], axis=-1)


def about_axis(axis: int, angle: ArrayLike) -> _Floats:
    """A turn by angle [...] [rad] about coordinate axis 0, 1 or 2: [..., 4]."""
    half = 0.5 * np.asarray(angle, dtype=np.float64)
    quat = np.zeros((*half.shape, 4))
    quat[..., 0] = np.cos(half)
    quat[..., 1 + axis] = np.sin(half)
    return quat


def about_axes(turns: Iterable[tuple[int, ArrayLike]]) -> _Floats:
    """The product of turns (axis, angle [rad]) from left to right; the identity where there are none."""
    quat = IDENTITY
    for axis, angle in turns:
        quat = multiply(quat, about_axis(axis, angle))
    return quat


def turned_angle(a: _Floats, b: _Floats) -> _Floats:
    """The angle [...] in [0, pi] [rad] between the rotations a and b."""
    between = multiply(conjugate(a), b)
    return 2.0 * np.arctan2(np.linalg.norm(between[..., 1:], axis=-1), np.abs(between[..., 0]))


def slerp(a: _Floats, b: _Floats, t: _Floats) -> _Floats:
    """Interpolate a [..., 4] to b [..., 4] along the shorter arc; t [...] in [0, 1] broadcasts."""
    cosine = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(cosine < 0.0, -b, b)
    angle = np.arccos(np.minimum(np.abs(cosine), 1.0))
    # sinc instead of sine, so that equal rotations divide by 1 and not by 0
    share = [
        np.sinc(part * angle / np.pi) * part / np.sinc(angle / np.pi) for part in (1.0 - t[..., None], t[..., None])
    ]
    quat = share[0] * a + share[1] * b
    return quat / np.linalg.norm(quat, axis=-1, keepdims=True)
