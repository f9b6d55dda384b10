"""What a user may tell the readers about a file instead of having it found out."""

import math
from dataclasses import dataclass

from murmillo.envs.errors import MotionError

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254, "in/0.45": 0.0254 / 0.45}
"""Metres in a unit. The last is Acclaim's: recordings of CMU, and BVH files made from them, have it."""
RATES = (0.01, 1e5)
"""[Hz] Between which every rate is that a recording can have."""


@dataclass(frozen=True)
class ReadOptions:
    """Facts about files that win over what the readers find out; None is found out, and reported.

    Attributes:
        up: the axis that points up, "y" or "z".
        unit: of lengths, a name in `UNITS` or the metres in one unit, as text: "0.0254".
        fps: frames a second [Hz].
        drop_rest: whether a rest pose at the start is left out.
        mirror: whether left and right are exchanged by reflecting the motion.

    Raises:
        MotionError: a value that none of these can have.
    """

    up: str | None = None
    unit: str | None = None
    fps: float | None = None
    drop_rest: bool | None = None
    mirror: bool | None = None

    def __post_init__(self) -> None:
        if self.up not in (None, "y", "z"):
            raise MotionError(f"up={self.up}: is no axis that can point up; give y or z")
        if self.fps is not None and not is_rate(self.fps):
            raise MotionError(
                f"fps={self.fps:g}: give the frames a second of the recording, from {RATES[0]:g} to {RATES[1]:g}"
            )
        if self.unit is not None:
            metres_in(self.unit)


def is_rate(fps: float) -> bool:
    """Whether a recording can have so many frames a second [Hz]."""
    return RATES[0] <= fps <= RATES[1]


def metres_in(unit: str) -> float:
    """The length of this unit [m].

    Raises:
        MotionError: neither a known name nor a number above 0.
    """
    try:
        metres = UNITS[unit] if unit in UNITS else float(unit)
    except ValueError:
        metres = math.nan
    if not 1e-6 < metres < 1e6:
        raise MotionError(f"unit={unit}: is unknown; give {', '.join(UNITS)}, or the metres in one unit as a number")
    return metres
