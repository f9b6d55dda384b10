"""What the constructors named in a pickle of numpy arrays are replaced with when a clip is read.

numpy's own would allocate what a file claims to hold, and change shared types as it says. These take what it does hold.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

_NUMBER_TYPES = ("f8", "f4", "i8", "i4", "b1", "u1")
_OBJECT = "O8"


class RefusedError(Exception):
    """What a file asks for is not data."""


def text(value: object) -> str:
    """The value, which must be text: keys of other kinds could take for ever to hash, or to print."""
    if type(value) is not str:
        raise TypeError
    return value


class Dtype:
    """Stands for numpy.dtype."""

    def __init__(self, code: str, align: object = False, copy: object = False) -> None:
        del align, copy
        if text(code) not in (*_NUMBER_TYPES, _OBJECT):
            raise RefusedError(f"holds values of type {code[:16]!a}; known are {', '.join(_NUMBER_TYPES)}")
        self._code = code
        self._order = "|"

    @property
    def is_object(self) -> bool:
        return self._code == _OBJECT

    def build(self, state: tuple[Any, ...]) -> None:
        self._order = {"<": "<", ">": ">", "|": "|"}[text(state[1])]

    def numbers(self, content: bytes) -> np.ndarray:
        if self.is_object:
            raise RefusedError("holds an object where numbers belong")
        return np.frombuffer(content, dtype=self._order + self._code)


class Array:
    """Stands for an ndarray; what it holds comes in a later instruction."""

    def __init__(self) -> None:
        self.value: Any = None

    def build(self, state: tuple[Any, ...]) -> None:
        _, shape, dtype, fortran, content = state
        sizes_known = all(type(size) is int and size >= 0 for size in shape)
        if not (isinstance(dtype, Dtype) and fortran is False and sizes_known):
            raise RefusedError("holds an array of an unknown layout")
        if not dtype.is_object:
            self.value = dtype.numbers(content).reshape(shape)
        elif math.prod(shape) == 1 and len(content) == 1:
            self.value = content[0]
        else:
            raise RefusedError("holds an array of several objects, where a clip is one")


def _ndarray() -> Array:
    raise RefusedError("makes an array in an unknown way")


def _reconstruct(kind: object, shape: object, code: object) -> Array:
    del shape, code  # an empty array's; its own follow
    if kind is not _ndarray:
        raise RefusedError("holds an array of a kind that is not numpy.ndarray")
    return Array()


def _scalar(dtype: Dtype, content: bytes) -> Any:
    (value,) = dtype.numbers(content)
    return value.item()


def _ordered_dict() -> dict[str, Any]:
    """Its items follow; only Python 2 gave them here."""
    return {}


def _encode(characters: str, encoding: str) -> bytes:
    """Python 3 writes bytes as latin1 text into pickles of protocol 2."""
    if encoding != "latin1":
        raise RefusedError("encodes text in an unknown way")
    return characters.encode("latin1")


CONSTRUCTORS: dict[tuple[str, str], Callable[..., Any]] = {
    ("numpy.core.multiarray", "_reconstruct"): _reconstruct,
    ("numpy._core.multiarray", "_reconstruct"): _reconstruct,
    ("numpy.core.multiarray", "scalar"): _scalar,
    ("numpy._core.multiarray", "scalar"): _scalar,
    ("numpy", "ndarray"): _ndarray,
    ("numpy", "dtype"): Dtype,
    ("collections", "OrderedDict"): _ordered_dict,
    ("_codecs", "encode"): _encode,
}
