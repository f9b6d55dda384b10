"""Reader of DeepMimic clips: JSON in .txt files, a frame a row of 44 numbers.

A row is the frame's duration [s], root position [m] and rotation (wxyz), then the joints: a quaternion (wxyz) each, or
the angle [rad] about z of a knee or an elbow. y is up. The format: DeepMimic's README, xbpeng/DeepMimic.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.conventions import settle
from murmillo.envs.motion.formats.humanoid import DEEPMIMIC
from murmillo.envs.motion.formats.json_data import number_rows, read_json
from murmillo.envs.motion.formats.options import RATES, ReadOptions
from murmillo.envs.motion.formats.quaternions import IDENTITY, about_axis, slerp
from murmillo.envs.motion.formats.raw_motion import RawMotion, check_size, checked, rate_of
from murmillo.envs.motion.formats.recording import Recording

_Floats = NDArray[np.float64]

_COLUMNS = {
    "root": 4,
    "chest": 4,
    "neck": 4,
    "right_hip": 4,
    "right_knee": 1,
    "right_ankle": 4,
    "right_shoulder": 4,
    "right_elbow": 1,
    "left_hip": 4,
    "left_knee": 1,
    "left_ankle": 4,
    "left_shoulder": 4,
    "left_elbow": 1,
}
"""Numbers of each joint, from column 4 on; wrists have none."""
_WIDTH = 4 + sum(_COLUMNS.values())
_DURATION_TOLERANCE = 0.02
_FRAME_TIMES = (1.0 / RATES[1], 10.0)
"""[s] Nothing that is a motion rests longer between two frames."""


def read_deepmimic(data: bytes, file: Path, options: ReadOptions) -> Recording:
    """The recording in the bytes of a DeepMimic clip of the humanoid; a clip that wraps is marked as a loop.

    Raises:
        MotionError: no such clip, or rows that are no poses.
    """
    content = read_json(data, str(file))
    rows = content.get("Frames")
    if not isinstance(rows, list):
        raise MotionError(f"{file}: has no list Frames and so is no DeepMimic clip; give a motion of humanoid3d")
    check_size(len(rows), len(DEEPMIMIC.names), str(file))
    frames = number_rows(rows, _WIDTH, "frame", str(file))
    quat = np.tile(IDENTITY, (len(frames), len(DEEPMIMIC.names), 1))
    column = 4
    for name, width in _COLUMNS.items():
        values = frames[:, column : column + width]
        quat[:, DEEPMIMIC.names.index(name)] = values if width == 4 else about_axis(2, values[:, 0])
        column += width
    raw = RawMotion(
        DEEPMIMIC, frames[:, 1:4], quat, options.fps or 0.0, up="y", unit=1.0, loop=content.get("Loop") == "wrap"
    )
    if options.fps is None:
        durations = _durations(frames[:, 0], file)
        raw = _at_one_rate(checked(raw, str(file)), durations, file)
    return settle(raw, file, options)


def _durations(column: _Floats, file: Path) -> _Floats:
    """Seconds from each frame to the next; what the last one says means nothing."""
    durations = column[:-1]
    if len(durations) == 0:
        raise MotionError(f"{file}: has fewer than 2 frames; get the file anew")
    broken = ~((durations >= _FRAME_TIMES[0]) & (durations < _FRAME_TIMES[1]))  # so written, a NaN is broken too
    if broken.any():
        frame = int(broken.argmax())
        raise MotionError(
            f"{file}: frame {frame} lasts {durations[frame]:g} s; correct its first number, or tell fps= (--fps)"
        )
    return durations


def _at_one_rate(raw: RawMotion, durations: _Floats, file: Path) -> RawMotion:
    """The motion at the rate of most frames, resampled where some last longer."""
    fps = rate_of(float(np.median(durations)))
    if np.allclose(durations * fps, 1.0, rtol=0.0, atol=_DURATION_TOLERANCE):
        return replace(raw, fps=fps)
    old = np.concatenate([[0.0], np.cumsum(durations)])
    count = round(float(old[-1]) * fps) + 1
    check_size(count, len(DEEPMIMIC.names), str(file))
    new = np.minimum(np.arange(count) / fps, old[-1])
    before = np.minimum(np.searchsorted(old, new, side="right") - 1, len(durations) - 1)
    part = (new - old[before]) / durations[before]
    return replace(
        raw,
        fps=fps,
        root_pos=raw.root_pos[before] + part[:, None] * (raw.root_pos[before + 1] - raw.root_pos[before]),
        quat=slerp(raw.quat[before], raw.quat[before + 1], part[:, None]),
        findings=raw.findings
        | {"frame durations": f"{durations.min():.3g} to {durations.max():.3g} s; resampled to one rate"},
    )
