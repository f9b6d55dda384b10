"""Where the feet are: planted until a step says otherwise, rolling over the toes, swinging to the next place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from murmillo.envs.motion.authored.timing import bump, minimum_jerk, swing, through_keys

# The foot's box in assets/mjcf/sword_shield.xml.
SOLE = 0.05  # ankle above the sole [m]
TOE = np.array([0.1335, 0.0, -SOLE])  # front edge of the sole, foot frame [m]
HEEL = np.array([-0.0435, 0.0, -SOLE])  # rear edge
CENTRE = np.array([0.045, 0.0, -SOLE])  # middle of the sole
TOUCHDOWN = (1.0, -0.9)  # forward and upward speed of a running foot as it lands [m/s]


@dataclass(frozen=True)
class Place:
    """A foothold on the ground: ankle position [m] and yaw [deg], counter-clockwise, world frame."""

    x: float
    y: float
    yaw: float = 0.0


@dataclass(frozen=True)
class Step:
    """One foot leaves the ground at `start` and lands at `end` [s].

    `lift` is the clearance at mid-swing [m]. Before leaving, the heel rises by `push` [deg] over the toe edge in
    `push_time`; the foot lands on the heel with the toes up by `strike` [deg], on the
    toes where it is negative, and is flat `flat_time` later.
    `via` are places of the foot in the air, (time, x, y, height above the ground, yaw, toes-down pitch [deg]): a kick.
    `flow` are places of the ankle, (time, x, y, z, toes-down pitch [deg]), that it swings through without pause: a run.
    """

    foot: str
    start: float
    end: float
    place: Place
    lift: float = 0.05
    push: float = 14.0
    push_time: float = 0.14
    strike: float = 0.0
    flat_time: float = 0.10
    via: tuple[tuple[float, ...], ...] = ()
    flow: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True)
class FootPath:
    """One foot over time: ankle [F, 3] [m], its rotation, the middle of what carries it [F, 2] [m], whether it is
    planted [F]."""

    ankle: np.ndarray
    rotation: Rotation
    centre: np.ndarray
    planted: np.ndarray


def foot_path(foot: str, start: Place, steps: Sequence[Step], time: np.ndarray) -> FootPath:
    """The path of the named foot ("left" or "right") that begins at `start` and takes its own among `steps`.

    Args:
        time: [F] [s].
    """
    position = np.tile([start.x, start.y, SOLE], (len(time), 1))
    yaw = np.full(len(time), float(start.yaw))
    pitch = np.zeros(len(time))  # toes down is positive
    planted = np.ones(len(time), bool)
    place = start
    for step in (s for s in steps if s.foot == foot):
        position, yaw, pitch = _take(step, place, time, position, yaw, pitch)
        planted &= (time <= step.start) | (time >= step.end)
        place = step.place
    rotation = Rotation.from_euler("ZY", np.stack([yaw, pitch], -1), degrees=True)
    # Rolling is about the edge that stays on the ground, so the ankle moves and the edge does not.
    position = position + _rolled(yaw, pitch)
    # With the heel well up, the toes carry.
    onto_toes = np.clip((pitch[:, None] - 15.0) / 15.0, 0.0, 1.0)
    pressed = position + rotation.apply(CENTRE + onto_toes * (TOE - CENTRE))
    return FootPath(position, rotation, pressed[:, :2], planted)


def _take(
    step: Step, place: Place, time: np.ndarray, position: np.ndarray, yaw: np.ndarray, pitch: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Write one step over the path from its push-off on; the positions are of the ankle as if the foot were flat."""
    if step.flow:
        return _swing_through(step, place, time, position, yaw, pitch)
    phase = (time - step.start) / (step.end - step.start)
    progress = swing(phase)
    there = np.array([step.place.x, step.place.y, SOLE])
    here = np.array([place.x, place.y, SOLE])
    position = np.where((phase > 0.0)[:, None], here + progress[:, None] * (there - here), position)
    turn = (step.place.yaw - place.yaw + 180.0) % 360.0 - 180.0
    yaw = np.where(phase > 0.0, place.yaw + progress * turn, yaw)
    push = step.push * minimum_jerk((time - step.start + step.push_time) / step.push_time)
    push = push * (1.0 - minimum_jerk(phase / 0.6))
    landing = -step.strike * minimum_jerk((phase - 0.4) / 0.6)
    landing = landing * (1.0 - minimum_jerk((time - step.end) / step.flat_time))
    position[:, 2] += step.lift * bump(phase)
    if step.via:
        inside = (time > step.start) & (time < step.end)
        air = _through_air(step, place, time)
        position[inside], yaw[inside], pitch[inside] = air[inside, :3], air[inside, 3], air[inside, 4]
        return position, yaw, pitch
    return position, yaw, pitch + push + landing


def _through_air(step: Step, place: Place, time: np.ndarray) -> np.ndarray:
    """The swing of a kick: x, y, z, yaw and pitch [F, 5] through the via places instead of straight to the landing."""
    keys = [(step.start, place.x, place.y, SOLE, place.yaw, 0.0)]
    keys += [(when, x, y, SOLE + height, yaw, pitch) for when, x, y, height, yaw, pitch in step.via]
    keys += [(step.end, step.place.x, step.place.y, SOLE, step.place.yaw, 0.0)]
    table = np.array(keys)
    return through_keys(table[:, 0], table[:, 1:], time)


def _swing_through(
    step: Step, place: Place, time: np.ndarray, position: np.ndarray, yaw: np.ndarray, pitch: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Write a step that flows: the toes leave and the heel lands at the speed at which the foot rolls on the ground."""
    flow = np.array(step.flow)
    when = np.concatenate([[step.start], flow[:, 0], [step.end]])
    table = np.empty((len(when), 4))  # x, y and z of the ankle as if the foot were flat, and pitch
    table[0] = place.x, place.y, SOLE, step.push
    table[-1] = step.place.x, step.place.y, SOLE, -step.strike
    yaw_there = through_keys(when[[0, -1]], np.array([[place.yaw], [step.place.yaw]]), when)[:, 0]
    table[1:-1] = np.column_stack([flow[:, 1:4] - _rolled(yaw_there[1:-1], flow[:, 4]), flow[:, 4]])
    leaving, landing = 2.0 * step.push / step.push_time, 2.0 * step.strike / step.flat_time
    way = table[-1, :2] - table[0, :2]
    touchdown = np.array([*(TOUCHDOWN[0] * way / np.linalg.norm(way)), TOUCHDOWN[1], landing])
    slopes = ((1, np.array([0.0, 0.0, 0.0, leaving])), (1, touchdown))
    spline = CubicSpline(when, table, bc_type=slopes)  # pyright: ignore[reportArgumentType]  (its stub knows names only)
    air = spline(np.clip(time, step.start, step.end))

    rolling = np.clip((time - step.start) / step.push_time + 1.0, 0.0, 1.0) ** 2
    settling = np.clip(1.0 - (time - step.end) / step.flat_time, 0.0, 1.0) ** 2
    inside, after = (time > step.start) & (time < step.end), time >= step.end
    position = np.where((inside | after)[:, None], air[:, :3], position)
    turned = through_keys(when[[0, -1]], yaw_there[[0, -1], None], time)[:, 0]
    yaw = np.where(inside | after, turned, yaw)
    pitch = np.where(inside, air[:, 3], pitch + step.push * np.where(time <= step.start, rolling, 0.0))
    return position, yaw, np.where(after, -step.strike * settling, pitch)


def _rolled(yaw: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    """How far the ankle moves [F, 3] when a foot of `yaw` rolls by `pitch` [deg] over the edge on the ground."""
    rotation = Rotation.from_euler("ZY", np.stack([yaw, pitch], -1), degrees=True)
    edge = np.where(pitch[:, None] > 0.0, TOE, HEEL)
    return Rotation.from_euler("Z", yaw[:, None], degrees=True).apply(edge) - rotation.apply(edge)
