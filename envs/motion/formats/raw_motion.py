"""What the readers make of a file before its axes and units are settled, and the bounds that every motion keeps."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.recording import Skeleton

_Floats = NDArray[np.float64]

MAX_JOINT_FRAMES = 5_000_000
"""Frames times joints of a recording: half an hour at 120 Hz of 23 joints. It bounds the memory of what follows."""
_LIMIT = 1e6
"""No position, in any unit, is as large."""
_NORMS = (0.5, 2.0)
"""Of quaternions, which are then made units: exporters that interpolate without that write the like (DeepMimic's kick
has 0.58)."""
_NOTED_NORM = 0.01


@dataclass(frozen=True, eq=False)
class RawMotion:
    """A recording in its file's own axes and unit.

    Attributes:
        skeleton, root_pos, quat: as in `Recording`.
        fps: frames a second.
        up: the axis that the format says points up; None where files differ.
        unit: metres in the file's unit, where the format says so.
        drift: by joint, how far [file's unit] it strays from the fixed place in its parent's frame that it is given.
        findings: what the reader found out.
        loop: whether the file says that the last frame leads into the first.
        fps_assumed: whether the file does not say how many frames a second it has.
    """

    skeleton: Skeleton
    root_pos: _Floats
    quat: _Floats
    fps: float
    up: str | None = None
    unit: float | None = None
    drift: dict[str, float] = field(default_factory=dict)
    findings: dict[str, str] = field(default_factory=dict)
    loop: bool = False
    fps_assumed: bool = False


def check_size(frames: int, joints: int, place: str) -> None:
    """Refuse a recording that would take up too much memory, before it does.

    Raises:
        MotionError: more than `MAX_JOINT_FRAMES`.
    """
    if frames * joints > MAX_JOINT_FRAMES:
        raise MotionError(
            f"{place}: {frames} frames of {joints} joints are more than murmillo reads at once; cut it into clips"
        )


def rate_of(frame_time: float) -> float:
    """Frames a second, from the seconds of one frame as files round them: 0.033333 s means 30 Hz."""
    fps = 1.0 / frame_time
    return float(round(fps)) if abs(fps - round(fps)) < 5e-4 * fps else fps


def checked(raw: RawMotion, place: str) -> RawMotion:
    """The motion with unit quaternions.

    Raises:
        MotionError: too few frames or too many, or numbers that no motion has; `place` names the file.
    """
    frames, joints = raw.quat.shape[:2]
    if frames < 2:
        raise MotionError(f"{place}: has {frames} frames; a clip needs at least 2, export it anew")
    check_size(frames, joints, place)
    for what, values in (("root position", raw.root_pos), ("rotations", raw.quat.reshape(frames, -1))):
        broken = ~(np.abs(values) < _LIMIT).all(axis=1)  # so written, a NaN is broken too
        if broken.any():
            frame = int(broken.argmax())
            raise MotionError(
                f"{place}: frame {frame}, {what}: has a NaN, an infinity or a number above {_LIMIT:g}; export it anew"
            )
    if not (np.abs(raw.skeleton.offsets) < _LIMIT).all():
        raise MotionError(f"{place}: a bone has a NaN, an infinity or a length above {_LIMIT:g}; export it anew")
    norm = np.linalg.norm(raw.quat, axis=-1)
    low, high = float(norm.min()), float(norm.max())
    if low < _NORMS[0] or high > _NORMS[1]:
        frame, joint = np.unravel_index(norm.argmin() if low < _NORMS[0] else norm.argmax(), norm.shape)
        raise MotionError(
            f"{place}: frame {frame}, {raw.skeleton.names[joint]}: its quaternion has norm {norm[frame, joint]:.3g}; "
            "export unit quaternions"
        )
    noted = max(1.0 - low, high - 1.0) > _NOTED_NORM
    note = {"quaternions": f"norms {low:.2f} to {high:.2f}; made units"} if noted else {}
    return replace(raw, quat=raw.quat / norm[..., None], findings=raw.findings | note)
