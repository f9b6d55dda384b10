"""Rotations from directions, batched over frames."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]


def unit(v: Floats) -> Floats:
    """The direction of v [..., 3]; where v is zero, zero."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)


def basis_zy(z: Floats, y: Floats) -> Rotation:
    """Rotations whose z axis is along z [F, 3], and whose y axis is as near to y [F, 3] as that allows."""
    z = unit(z)
    x = _across(y, z)
    return Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=-1))


def basis_yz(y: Floats, z: Floats) -> Rotation:
    """Rotations whose y axis is along y [F, 3], and whose z axis is as near to z [F, 3] as that allows."""
    y = unit(y)
    x = _across(y, z)
    return Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=-1))


def swung(rotation: Rotation, axis: Floats, to: Floats) -> Rotation:
    """The rotations [F] turned the shortest way so that `axis` [3] of theirs points along `to` [F, 3]."""
    now, to = rotation.apply(axis), unit(to)
    return turn_between(now, to) * rotation


def turn_between(a: Floats, b: Floats) -> Rotation:
    """The smallest rotations that take the unit vectors a [F, 3] to b [F, 3]; half a turn is about an axis across a."""
    cross = np.cross(a, b)
    real = 1.0 + np.sum(a * b, axis=-1)
    opposite = real < 1e-9
    cross = np.where(opposite[..., None], _any_across(a), cross)
    return Rotation.from_quat(np.concatenate([np.where(opposite, 0.0, real)[..., None], cross], -1), scalar_first=True)


def _across(a: Floats, b: Floats) -> Floats:
    """The direction [F, 3] of a x b; any direction across b where a is along it."""
    cross = np.cross(a, b)
    parallel = np.linalg.norm(cross, axis=-1, keepdims=True) < 1e-9 * np.linalg.norm(a, axis=-1, keepdims=True) + 1e-30
    return unit(np.where(parallel, _any_across(b), cross))


def _any_across(a: Floats) -> Floats:
    return np.cross(a, np.where(np.abs(a[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))


def smoothstep(x: Floats, low: float, high: float) -> Floats:
    """0 below `low`, 1 above `high`, with level ends in between."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)
