"""The last touch to solved poses: no joint faster than muscles are, no body left in the ground."""

import numpy as np
from scipy.ndimage import binary_dilation, gaussian_filter1d, maximum_filter1d

from murmillo.envs.motion.retarget.bases import Floats
from murmillo.envs.motion.retarget.figure import Figure

_FASTEST = 23.0  # of a joint coordinate [rad/s]; less than the 25 that a clip may have, for those of balls are no rates
_ROUNDS = 8
_AROUND = 3  # frames before and after a leap that are smoothed with it


def calmed(qpos: Floats, figure: Figure, fps: float) -> Floats:
    """The poses [F, nq] with leaps of a joint spread over the frames about them; other frames stay as they are."""
    values = figure.coordinates(qpos)
    for _ in range(_ROUNDS):
        leaps = np.abs(np.diff(values, axis=0)) * fps > _FASTEST
        if not leaps.any():
            break
        ends = np.concatenate([leaps, leaps[:1] & False]) | np.concatenate([leaps[:1] & False, leaps])
        about = binary_dilation(ends, structure=np.ones((2 * _AROUND + 1, 1)))
        values = np.where(about, gaussian_filter1d(values, 1.0, axis=0, mode="nearest"), values)
    return figure.posed(values, qpos)


def lifted(qpos: Floats, lowest: Floats, fps: float) -> Floats:
    """The poses [F, nq], whose lowest points are at `lowest` [F] [m], raised smoothly where these are in the ground."""
    sunk = np.maximum(0.0, -lowest)
    raised = qpos.copy()
    raised[:, 2] += np.maximum(sunk, gaussian_filter1d(maximum_filter1d(sunk, 5), 0.05 * fps))
    return raised
