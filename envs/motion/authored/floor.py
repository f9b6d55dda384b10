"""Falls and get-ups: key poses told by where the body touches the ground, solved to a whole-body motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from scipy.spatial.transform import Rotation, Slerp

from murmillo.envs.character import Character
from murmillo.envs.motion.authored.timing import FPS, bump, smooth, through_keys
from murmillo.envs.motion.authored.tumbler import SIDES, STANDING, Low, Stand, Tumbler

HELD, HELD_TURN = 0.005, 0.05  # a point or a sole that two keys leave so near rests in between [m], [rad]
LIFT = 0.03  # of a foot on its way to another place, so that it does not slide [m]
SMOOTH = 0.03  # standard deviation of the smoothing over time [s]


@dataclass(frozen=True)
class FloorTake:
    """One skill near the ground as its author writes it: poses, and the time of each [s]."""

    loop: ClassVar[bool] = False

    label: str
    keys: Sequence[tuple[float, Low | Stand]]


def perform_on_floor(take: FloorTake, character: Character) -> np.ndarray:
    """The take as qpos [F, nq] at 30 frames a second; the last key is the last frame."""
    tumbler = Tumbler(character)
    key_times = np.array([time for time, _ in take.keys])
    time = np.arange(round(key_times[-1] * FPS) + 1) / FPS
    keys = _solved(tumbler, [pose for _, pose in take.keys])

    poses = _parted(character, np.stack([key.qpos for key in keys]))
    wished = _joined(character, through_keys(key_times, poses, time))
    values = _parted(character, _follow(tumbler, wished, keys, key_times, time))
    smoothed = smooth(values, SMOOTH, FPS)
    smoothed[[0, -1]] = values[[0, -1]]
    return _follow(tumbler, _joined(character, smoothed), keys, key_times, time)


@dataclass(frozen=True)
class _Key:
    """A solved key: its pose [nq], where its points came to be [m], and how its soles lie."""

    qpos: np.ndarray
    points: Mapping[str, np.ndarray]
    soles: Mapping[str, Rotation]


def _solved(tumbler: Tumbler, poses: Sequence[Low | Stand]) -> list[_Key]:
    """Each key sought from the one before; but the ends from a loose crouch, so that they are alike in every take."""
    first, last = _solve(tumbler, poses[0]), _solve(tumbler, poses[-1])
    keys = [first]
    for pose in poses[1:]:
        ends = [end for end, known in ((first, poses[0]), (last, poses[-1])) if pose == known]
        keys.append(ends[0] if ends else _solve(tumbler, pose, keys[-1].qpos))
    return keys


def _solve(tumbler: Tumbler, pose: Low | Stand, start: np.ndarray | None = None) -> _Key:
    qpos = tumbler.pose(pose, start)
    standing = isinstance(pose, Stand)
    points = STANDING if standing else tuple(pose.points)
    soles = ("left", "right") if standing else tuple(pose.soles)
    return _Key(qpos, tumbler.places(points), {side: tumbler.sole(side) for side in soles})


def _parted(character: Character, qpos: np.ndarray) -> np.ndarray:
    """Poses [F, nq] as joint coordinates, position and rotation vector of the root [F, A + 6]."""
    coordinates = character.joint_coordinates(torch.from_numpy(qpos)).numpy()
    return np.column_stack([coordinates, qpos[:, :3], Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_rotvec()])


def _joined(character: Character, values: np.ndarray) -> np.ndarray:
    """Inverse of `_parted`: poses [F, nq]."""
    rotation = Rotation.from_rotvec(values[:, -3:]).as_quat(scalar_first=True)
    parts = (values[:, :-6].copy(), values[:, -6:-3].copy(), rotation)
    return character.pose(*(torch.from_numpy(part) for part in parts)).numpy()


def _follow(
    tumbler: Tumbler, wished: np.ndarray, keys: Sequence[_Key], key_times: np.ndarray, time: np.ndarray
) -> np.ndarray:
    """Every frame solved in turn [F, nq]: what rests between two keys rests, nothing passes through anything."""
    tumbler.start_from(keys[0].qpos)
    frames = []
    for pose, now in zip(wished, time, strict=True):
        last = int(np.clip(np.searchsorted(key_times, now, side="right") - 1, 0, len(keys) - 2))
        phase = (now - key_times[last]) / (key_times[last + 1] - key_times[last])
        frames.append(tumbler.follow(pose, *_resting(keys[last], keys[last + 1], phase)))
    return np.stack(frames)


def _resting(a: _Key, b: _Key, phase: float) -> tuple[dict[str, np.ndarray], dict[str, Rotation], dict[str, float]]:
    """The points and soles that both keys leave in one place; the feet that go elsewhere are lifted."""
    points = {
        name: (1.0 - phase) * place + phase * b.points[name]
        for name, place in a.points.items()
        if name in b.points and np.linalg.norm(place - b.points[name]) < HELD
    }
    soles = {
        side: Slerp([0.0, 1.0], Rotation.concatenate([rotation, b.soles[side]]))(phase)
        for side, rotation in a.soles.items()
        if side in b.soles and (rotation.inv() * b.soles[side]).magnitude() < HELD_TURN
    }
    lifted = [side for side in SIDES if not any(name in points for name in (f"{side}_heel", f"{side}_toe"))]
    return points, soles, {f"{side}_foot": LIFT * float(bump(phase)) ** 0.5 for side in lifted}
