"""JSON files, read within bounds."""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.table import check_numbers

_MAX_BYTES = 64 * 2**20
_MAX_CONTAINERS = 2_000_000
_MAX_VALUES = 10_000_000
"""Lists, maps and values cost much more memory than their text; these bound it to about 500 MB."""


def read_json(data: bytes, place: str) -> dict[str, Any]:
    """The map that the file holds.

    Raises:
        MotionError: no JSON, no map, or too much of it; `place` names the file.
    """
    large = len(data) > _MAX_BYTES or data.count(b",") > _MAX_VALUES
    if large or data.count(b"[") + data.count(b"{") > _MAX_CONTAINERS:
        raise MotionError(f"{place}: is too large for one clip; cut the recording into clips")
    try:
        content = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError):  # UnicodeDecodeError is a ValueError
        raise MotionError(f"{place}: is no JSON, or cut short; get the file anew") from None
    if not isinstance(content, dict):
        raise MotionError(f"{place}: holds no map and so no motion; get the file anew")
    return content


def number_rows(rows: list[Any], width: int, what: str, place: str) -> NDArray[np.float64]:
    """These lists of `width` numbers each, as [len(rows), width].

    Raises:
        MotionError: another width, or something that is no number, or none of a motion; `what` names a row.
    """
    for i, row in enumerate(rows):
        if not (isinstance(row, list) and len(row) == width and all(type(value) in (float, int) for value in row)):
            raise MotionError(f"{place}: {what} {i} is not a list of {width} numbers; get the file anew")
    try:
        values = np.array(rows, dtype=np.float64).reshape(len(rows), width)
    except OverflowError:
        raise MotionError(f"{place}: a {what} has a number that is too large; get the file anew") from None
    check_numbers(values, what, place)
    return values
