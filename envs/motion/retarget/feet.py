"""Feet that stand where they stand: stance is found by height and speed, then held; no sole goes below the ground."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.spatial.transform import Rotation

from murmillo.envs.motion.retarget.anatomy import Foot
from murmillo.envs.motion.retarget.bases import Floats, basis_zy, smoothstep
from murmillo.envs.motion.retarget.figure import Sole

_ENTER_HEIGHT, _LEAVE_HEIGHT = 0.03, 0.05  # of heel or toes above the ground [m]
_ENTER_SPEED, _LEAVE_SPEED = 0.25, 0.40  # of heel or toes along the ground [m/s]
_LEVEL = np.radians(12.0)  # a foot that tilts by less may lie on the ground
_FLAT = np.radians(8.0)  # a standing foot that tilts by less is flat
_SHORTEST = 0.06  # [s] of a stance
_DRIFT, _TURN = 0.06, np.radians(8.0)  # a recorded foot that strays no further than this while it stands is still
_CLEARANCE = 0.02  # of a swinging foot [m]; one that brushes the ground would be taught as sliding
_LIFT_OFF = 2  # frames until it has that
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class FootPath:
    """A foot over time: its ankle [F, 3] [m], its rotations [F], and whether it stands [F]; world frame."""

    ankle: Floats
    rotation: Rotation
    standing: NDArray[np.bool_]


def foot_rotation(foot: Foot, shin: Rotation, scale: float, fps: float) -> Rotation:
    """Frames of a foot [F].

    Where the foot is lowest and still under an upright shin it is taken to be flat, and to point from ankle to toes.
    Without such a moment it is as the rest pose shows it, or else at a right angle to the shin on average.
    """
    joints = [foot.ankle] if foot.toe is None else [foot.ankle, foot.toe]
    flat = shin.apply(_UP)[:, 2] > 0.7
    for joint in joints:
        flat &= scale * (joint[:, 2] - np.percentile(joint[:, 2], 2.0)) < 0.015
        flat &= scale * _speed(joint, fps) < 0.2
    carrier = foot.carrier
    if foot.standing is not None and (foot.toe is None or flat.sum() < 3):
        return carrier * foot.standing
    if flat.sum() < 3:
        return carrier * (carrier.inv() * shin).mean()
    ahead = shin.apply([1.0, 0.0, 0.0]) if foot.toe is None else foot.toe - foot.ankle
    level = basis_zy(np.tile(_UP, (flat.sum(), 1)), np.cross(_UP, ahead[flat]))
    return carrier * (carrier[flat].inv() * level).mean()


def ground_height(feet: list[tuple[Floats, Rotation, Sole]], fps: float) -> float:
    """How high the ground is under feet (ankle [F, 3], rotations [F], sole): the soles' height where they lie on it.

    That is where a foot is level, slow and low. A tilted foot says nothing: a human's bends at the toes.
    """
    heights, levels, slows = [], [], []
    for ankle, rotation, sole in feet:
        heights.append(ankle[:, 2] + _lowest(rotation, sole))
        levels.append(rotation.apply(_UP)[:, 2] > np.cos(_LEVEL))
        slows.append(_speed(ankle, fps) < _LEAVE_SPEED)
    height, lying = np.concatenate(heights), np.concatenate(levels) & np.concatenate(slows)
    if not lying.any():
        return float(np.percentile(height, 10.0))
    height = height[lying]
    return float(np.median(height[height < np.percentile(height, 10.0) + _LEAVE_HEIGHT]))


def find_standing(ankle: Floats, rotation: Rotation, sole: Sole, fps: float) -> NDArray[np.bool_]:
    """Whether a foot stands [F]: its heel or its toes are near the ground and slow, and its sole does not look up."""
    touching = np.zeros(len(ankle), dtype=bool)
    for point in (sole.toe, sole.heel):
        path = ankle + rotation.apply(point)
        speed = _speed(path, fps)
        sure = (path[:, 2] < _ENTER_HEIGHT) & (speed < _ENTER_SPEED)
        still = (path[:, 2] < _LEAVE_HEIGHT) & (speed < _LEAVE_SPEED)
        touching |= _hysteresis(sure, still)
    touching &= rotation.apply(_UP)[:, 2] > 0.3
    shortest = max(2, round(_SHORTEST * fps))
    for run in _runs(touching):
        touching[run] = run.stop - run.start >= shortest
    return touching


def plant(ankle: Floats, rotation: Rotation, sole: Sole, fps: float) -> FootPath:
    """The path of a foot whose stances are held still; in between, the correction passes from one to the next.

    A standing foot keeps its place and heading, is flat or rolls over its heel or its toes, and touches the ground.
    """
    standing = find_standing(ankle, rotation, sole, fps)
    runs = _runs(standing)
    shift, turn = np.zeros_like(ankle), np.zeros_like(ankle)
    for run in runs:
        held, level = _hold(ankle[run], rotation[run], sole)
        shift[run] = held - ankle[run]
        turn[run] = (level * rotation[run].inv()).as_rotvec()
    if runs:
        _pass_on(shift, runs)
        _pass_on(turn, runs)
    rotation = Rotation.from_rotvec(turn) * rotation
    ankle = ankle + shift
    clear = _CLEARANCE * np.minimum(1.0, _frames_to(standing) / _LIFT_OFF)
    lift = np.maximum(0.0, clear - ankle[:, 2] - _lowest(rotation, sole))
    ankle = ankle + np.where(standing, 0.0, lift)[:, None] * _UP
    return FootPath(ankle, rotation, standing)


def sinking(hips: Floats, ankles: Floats, reach: float, fps: float) -> Floats:
    """How much hips [F, 2, 3] must sink [F] [m] so that no leg to its ankle [F, 2, 3] is longer than `reach` [m]."""
    across = np.linalg.norm(ankles[..., :2] - hips[..., :2], axis=-1)
    highest = ankles[..., 2] + np.sqrt(np.maximum(reach**2 - across**2, 0.0))
    excess = np.maximum(0.0, hips[..., 2] - highest).max(axis=1)
    width = max(1, round(0.2 * fps))
    return gaussian_filter1d(maximum_filter1d(excess, width, mode="nearest"), 0.06 * fps, mode="nearest")


def _speed(position: Floats, fps: float) -> Floats:
    """Along the ground [F] [m/s]; the frames are at least two."""
    return np.linalg.norm(np.gradient(position[:, :2], axis=0), axis=1) * fps


def _lowest(rotation: Rotation, sole: Sole) -> Floats:
    """Height [F] of the sole's lowest corner above the ankle (negative) [m]."""
    return np.min([rotation.apply(corner)[:, 2] for corner in sole.corners], axis=0)


def _hysteresis(sure: NDArray[np.bool_], still: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Runs of `still` that hold a frame of `sure`."""
    result = np.zeros_like(still)
    for run in _runs(still):
        result[run] = sure[run].any()
    return result


def _runs(flags: NDArray[np.bool_]) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _hold(ankle: Floats, rotation: Rotation, sole: Sole) -> tuple[Floats, Rotation]:
    """Ankle [n, 3] and rotations [n] of a foot that stands for n frames, as near to the recorded ones as may be."""
    ahead = rotation.apply([1.0, 0.0, 0.0])
    yaw = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    tilt = -np.arcsin(np.clip(ahead[:, 2], -1.0, 1.0))  # toes down is positive
    # the character's foot does not bend at the toes: it rises over them only as far as the recorded ankle rises
    length = np.hypot(sole.toe[0], sole.toe[2])
    risen = np.arcsin(np.clip(ankle[:, 2] / length, -1.0, 1.0)) - np.arctan2(-sole.toe[2], sole.toe[0])
    tilt = np.where(tilt > 0.0, np.clip(risen, 0.0, tilt), tilt)
    tilt = np.sign(tilt) * np.maximum(0.0, np.abs(tilt) - _FLAT)
    level = Rotation.from_euler("ZY", np.stack([_lag(yaw[:, None], _TURN)[:, 0], tilt], axis=-1))
    edges = np.stack([ankle + rotation.apply(edge) for edge in (sole.toe, sole.heel)])
    moved = np.linalg.norm(np.diff(edges, axis=1), axis=-1)
    tilted = tilt[1:] + tilt[:-1]
    on_toe = np.where(tilted == 0.0, moved[0] < moved[1], tilted > 0.0)
    edge = np.where(on_toe[:, None], sole.toe, sole.heel)
    rolled = level[:-1].apply(edge) - level[1:].apply(edge)
    path = np.concatenate([np.zeros((1, 3)), rolled.cumsum(axis=0)])
    path += _lag(ankle - path, _DRIFT)
    path[:, 2] = -_lowest(level, sole)
    return path, level


def _lag(values: Floats, slack: float) -> Floats:
    """The values [n, d] followed as by a weight on a string of length `slack`: what strays by less does not move it."""
    held = np.empty_like(values)
    now = values.mean(axis=0)
    for frame, value in enumerate(values):
        away = now - value
        distance = np.linalg.norm(away)
        now = value + away * (slack / distance) if distance > slack else now
        held[frame] = now
    return held


def _frames_to(flags: NDArray[np.bool_]) -> Floats:
    """How many frames each frame [F] is from the nearest one that is flagged."""
    frames = np.arange(len(flags))
    before = np.maximum.accumulate(np.where(flags, frames, -np.inf))
    after = np.minimum.accumulate(np.where(flags, frames, np.inf)[::-1])[::-1]
    return np.minimum(frames - before, after - frames)


def _pass_on(correction: Floats, runs: list[slice]) -> None:
    """Fill the correction [F, 3] between the runs, smoothly from the end of one to the start of the next; in place."""
    correction[: runs[0].start] = correction[runs[0].start]
    correction[runs[-1].stop :] = correction[runs[-1].stop - 1]
    for before, after in pairwise(runs):
        gap = after.start - before.stop
        way = smoothstep(np.arange(1, gap + 1) / (gap + 1), 0.0, 1.0)[:, None]
        correction[before.stop : after.start] = (1 - way) * correction[before.stop - 1] + way * correction[after.start]
