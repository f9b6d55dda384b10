"""The .npy container, read without numpy's loader: nothing is evaluated, nothing allocated beyond the file's size."""

import re
import struct

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError

_MAGIC = b"\x93NUMPY"
_NUMBERS = ("<f2", "<f4", "<f8", ">f4", ">f8", "<i4", "<i8", "<u4", "<u8", "|i1", "|u1")
_HEADER = re.compile(
    r"\{'descr': '([^']{1,16})', 'fortran_order': (True|False), 'shape': \(((?:\d{1,12}(?:, ?|(?=\)))){0,8})\), \}\s*"
)


def split_npy(data: bytes, place: str) -> tuple[str, tuple[int, ...], bytes]:
    """Take a .npy file apart: its dtype code such as "<f8" or "|O", its shape, and the bytes after the header.

    Raises:
        MotionError: not a .npy file, an unknown header, or Fortran order; `place` names the file.
    """
    if not data.startswith(_MAGIC):
        raise MotionError(f"{place}: is no .npy file; give a clip that numpy saved")
    major = data[6] if len(data) > 8 else 0
    layout = {1: "<H", 2: "<I", 3: "<I"}.get(major)
    if layout is None:
        raise MotionError(f"{place}: .npy of version {major}, or cut short; save it anew with numpy.save")
    start = 8 + struct.calcsize(layout)
    if len(data) < start:
        raise MotionError(f"{place}: ends within its header; copy the file anew")
    end = start + struct.unpack_from(layout, data, 8)[0]
    header = _HEADER.fullmatch(data[start : min(end, start + 10_000)].decode("latin1"))
    if header is None or len(data) < end:
        raise MotionError(f"{place}: the .npy header cannot be read; the file is cut short or damaged, copy it anew")
    descr, fortran, sizes = header.groups()
    if fortran == "True":
        raise MotionError(f"{place}: the array is in Fortran order; save numpy.ascontiguousarray of it")
    return descr, tuple(int(size) for size in re.findall(r"\d+", sizes)), data[end:]


def read_numbers(data: bytes, place: str) -> NDArray[np.float64]:
    """The array of a .npy file of numbers of any usual type, as float64.

    Raises:
        MotionError: not numbers, or more or fewer of them than the header states.
    """
    descr, shape, payload = split_npy(data, place)
    if descr not in _NUMBERS:
        raise MotionError(f"{place}: holds values of type {descr!a}; save numbers, such as float64 (<f8)")
    return _shaped(payload, descr, shape, place).astype(np.float64)


def read_float_array(data: bytes, place: str) -> NDArray[np.float64]:
    """The array of a .npy file of little-endian float64, read-only.

    Raises:
        MotionError: another dtype, or more or fewer numbers than the header states.
    """
    descr, shape, payload = split_npy(data, place)
    if descr != "<f8":
        raise MotionError(f"{place}: holds numbers of type {descr}; save float64 (<f8)")
    return _shaped(payload, descr, shape, place)


def _shaped(payload: bytes, descr: str, shape: tuple[int, ...], place: str) -> NDArray:
    try:
        return np.frombuffer(payload, dtype=descr).reshape(shape)
    except ValueError:
        raise MotionError(
            f"{place}: {len(payload)} bytes do not make the shape {list(shape)}; copy the file anew"
        ) from None
