"""How values move in time: minimum jerk between keys, and the centre of mass that a centre of pressure asks for."""

import numpy as np
from scipy.interpolate import BPoly, PchipInterpolator
from scipy.ndimage import gaussian_filter1d

FPS = 30.0
GRAVITY = 9.81  # [m/s^2]
CARRIED = 0.05  # how slowly the load on the legs may change [s]
FIRMLY = 1e3  # weight of what must hold against what is wished


def minimum_jerk(phase: np.ndarray | float) -> np.ndarray:
    """Rest-to-rest minimum-jerk profile of a phase in [0, 1] (Flash and Hogan 1985, eq. 3); clamped outside."""
    s = np.clip(phase, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def swing(phase: np.ndarray | float) -> np.ndarray:
    """Progress of a swinging foot in a phase in [0, 1]: least acceleration, for minimum jerk reaches out too early."""
    s = np.clip(phase, 0.0, 1.0)
    return s**2 * (3.0 - 2.0 * s)


def bump(phase: np.ndarray | float) -> np.ndarray:
    """Hill of height 1 over a phase in [0, 1], level at the ends; it rises and falls before `swing` has moved on."""
    s = np.clip(phase, 0.0, 1.0)
    return 7.44 * s**1.4 * (1.0 - s) ** 1.5


def ramp(time: np.ndarray, start: float, end: float) -> np.ndarray:
    """Minimum-jerk rise from 0 at `start` to 1 at `end` [s]."""
    return minimum_jerk((time - start) / (end - start))


def through_keys(key_times: np.ndarray, key_values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Minimum-jerk pieces through keys: rest at the first, the last and each turning point, no overshoot between.

    Each piece is the quintic of least jerk between its ends, with no acceleration there and the velocities of monotone
    cubic interpolation (Fritsch and Carlson 1980). Bounded by twice the mean velocities on both sides of the key, these
    keep the quintic monotone too: values that stay in a box at the keys stay in it throughout.

    Args:
        key_times: [K] increasing [s].
        key_values: [K, D].
        time: [F] [s]; clamped to the first and last key.

    Returns:
        [F, D].
    """
    slopes = PchipInterpolator(key_times, key_values, axis=0).derivative()(key_times)
    slopes[[0, -1]] = 0.0
    mean = np.abs(np.diff(key_values, axis=0) / np.diff(key_times)[:, None])
    bound = 2.0 * np.minimum(mean[:-1], mean[1:])
    slopes[1:-1] = np.clip(slopes[1:-1], -bound, bound)
    knots = np.stack([key_values, slopes, np.zeros_like(slopes)], axis=1)
    return BPoly.from_derivatives(key_times, knots)(np.clip(time, key_times[0], key_times[-1]))


def smooth(values: np.ndarray, seconds: float, rate: float) -> np.ndarray:
    """Gaussian smoothing along the first axis, standard deviation in [s], samples at `rate` [Hz]."""
    return gaussian_filter1d(values, seconds * rate, axis=0, mode="nearest")


def free_fall(wished: np.ndarray, airborne: np.ndarray, rate: float) -> np.ndarray:
    """The height of the centre of mass that falls freely in the air and is carried as smoothly as may be elsewhere.

    Least squares: near what is wished, with little jerk, at rest at both ends, and with the acceleration of gravity in
    every frame in the air. How far the body sinks into a landing and rises into a take-off follows from that: what a
    flight takes from the load, the stances around it carry more.

    Args:
        wished: [F] [m].
        airborne: [F] whether no foot stands.
        rate: samples per second [Hz].

    Returns:
        [F] [m].
    """
    frames = len(wished)
    second = np.diff(np.eye(frames), n=2, axis=0) * rate**2
    jerk = np.diff(np.eye(frames), n=3, axis=0) * (rate * CARRIED) ** 3
    falling = airborne[1:-1]
    ends = [0, 1, frames - 2, frames - 1]
    rows = np.vstack([np.eye(frames), jerk, FIRMLY * second[falling], FIRMLY * np.eye(frames)[ends]])
    wishes = [wished, np.zeros(len(jerk)), np.full(falling.sum(), -FIRMLY * GRAVITY), FIRMLY * wished[ends]]
    return np.linalg.lstsq(rows, np.concatenate(wishes), rcond=None)[0]


def load_of(height: np.ndarray, rate: float) -> np.ndarray:
    """The share of its weight that the ground carries [F], of a centre of mass at `height` [F] [m]; 0 in free fall."""
    lifted = np.zeros(len(height))
    lifted[1:-1] = np.diff(height, n=2) * rate**2
    return np.maximum(1.0 + lifted / GRAVITY, 0.0)


def centre_of_mass(pressure: np.ndarray, height: float, rate: float, load: np.ndarray | None = None) -> np.ndarray:
    """The horizontal path of the centre of mass whose centre of pressure is given, at rest over it at both ends.

    The cart on a table, p = c - (h / g) c'' (Kajita et al. 2003, eq. 5), solved for the whole clip at once: the body
    leans ahead of a step that is still to come, as people do. Where the rest at the ends contradicts it, the centre of
    pressure gives way by as little as possible in the least-squares sense. A load n other than the weight scales the
    ground's pull: n (p - c) = -(h / g) c'', so that nothing pulls in the air.

    Args:
        pressure: [F, 2] centre of pressure on the ground [m].
        height: of the centre of mass [m].
        rate: samples per second [Hz].
        load: [F] on the ground, as a share of the weight; 1 if it is not given.

    Returns:
        [F, 2] [m].
    """
    frames = len(pressure)
    share = np.ones(frames - 2) if load is None else load[1:-1]
    k = height / GRAVITY * rate**2
    cart = np.zeros((frames - 2, frames))
    row = np.arange(frames - 2)
    cart[row, row], cart[row, row + 1], cart[row, row + 2] = -k, share + 2.0 * k, -k
    path = np.empty_like(pressure)
    path[:2], path[-2:] = pressure[0], pressure[-1]
    wished = share[:, None] * pressure[1:-1] - cart[:, :2] @ path[:2] - cart[:, -2:] @ path[-2:]
    path[2:-2] = np.linalg.lstsq(cart[:, 2:-2], wished, rcond=None)[0]
    return path
