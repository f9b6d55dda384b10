"""Lines of numbers, as BVH and AMC have them."""

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError

_LIMIT = 1e6
"""No position, in any unit, and no angle is as large."""
_WORD = 64
"""Bytes of a number and the blanks around it, at most on average. It bounds what a line can become in memory."""


def check_numbers(values: NDArray[np.float64], row_name: str, place: str) -> None:
    """Refuse values [R, C] that no motion has.

    Raises:
        MotionError: naming the first row with a NaN, an infinity or a number beyond all bounds.
    """
    broken = ~(np.abs(values) < _LIMIT).all(axis=1)  # so written, a NaN is broken too
    if broken.any():
        raise MotionError(
            f"{place}: {row_name} {int(broken.argmax())} has a NaN, an infinity or a number above {_LIMIT:g}; "
            "cut it out or export the motion anew"
        )


def read_table(lines: list[bytes], columns: int, row_name: str, place: str) -> NDArray[np.float64]:
    """The numbers [len(lines), columns], which blanks separate.

    Args:
        row_name: what a line is, such as "frame", and `place` where they all are, for the error.

    Raises:
        MotionError: another count of numbers in a line, or something that is no number, or none of a motion.
    """
    long = next((row for row, line in enumerate(lines) if len(line) > _WORD * (columns + 1)), None)
    if long is not None:
        raise MotionError(
            f"{place}: {row_name} {long} has {len(lines[long])} bytes where {columns} numbers belong; export it anew"
        )
    values = np.zeros((len(lines), 0))
    if any(line.strip() for line in lines):  # loadtxt warns of a table without numbers
        try:
            # what is not ASCII must not pass for a blank
            values = np.loadtxt((line.decode("ascii", errors="replace") for line in lines), comments=None, ndmin=2)
        except ValueError:
            values = np.zeros((0, 0))
    if values.shape == (len(lines), columns):
        check_numbers(values, row_name, place)
        return values
    for row, line in enumerate(lines):
        words = line.split()
        if len(words) != columns:
            raise MotionError(
                f"{place}: {row_name} {row} has {len(words)} numbers where {columns} belong; export it anew"
            )
        for word in words:
            if not _is_number(word):
                raise MotionError(
                    f"{place}: {row_name} {row}: {word[:40].decode('latin-1')!a} is no number; export it anew"
                )
    raise MotionError(f"{place}: its numbers cannot be read; export it anew")


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word
