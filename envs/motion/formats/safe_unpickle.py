"""Read pickles of plain data and numpy arrays without ever running what a file asks for.

A pickle is a program for a small stack machine, and Python's own machine imports and calls whatever the program names.
This one knows the few instructions that data needs, and calls only the stand-ins of `pickled_numpy`. Everything else it
refuses by name. Memory and time stay in proportion to the file.
The instructions: https://docs.python.org/3/library/pickletools.html
"""

import struct
from collections.abc import Callable
from typing import Any

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.pickled_numpy import CONSTRUCTORS, Array, Dtype, RefusedError, text

_MAX_INSTRUCTIONS = 100_000
"""A clip needs some four hundred. Each may make an object, so this bounds memory."""
_MAX_DEPTH = 16

_MARK = object()


def read_pickle(data: bytes, place: str) -> Any:
    """The plain data in a pickle of protocol 2 to 4: numeric arrays, numbers, text, bytes, and containers of them.

    Keys are text. Arrays are read-only views of the file's bytes; an OrderedDict comes as a dict.

    Raises:
        MotionError: damaged, or asking for anything else; `place` names the file.
    """
    try:
        return _resolve(_Machine(data).run(), {}, 0)
    except RefusedError as refusal:
        raise MotionError(f"{place}: {refusal}; nothing of it was run, get the file from a source you trust") from None
    except (EOFError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError, struct.error):
        # what a damaged program trips over; UnicodeError is a ValueError
        raise MotionError(f"{place}: the pickle is cut short or damaged; copy the file anew") from None


class _Machine:
    """The pickle machine: a stack with marks on it, and a memo of what was on it."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0
        self._stack: list[Any] = []
        self._memo: dict[int, Any] = {}
        self._encoded = 0

    def run(self) -> Any:
        for _ in range(_MAX_INSTRUCTIONS):
            code = self._take(1)
            if code == b".":
                (value,) = self._stack
                return value
            self._execute(code)
        raise RefusedError(f"has more than {_MAX_INSTRUCTIONS} pickle instructions")

    def _execute(self, code: bytes) -> None:
        if code in _CONSTANTS:
            self._stack.append(_CONSTANTS[code])
        elif code in _NUMBERS:
            self._stack.append(self._number(_NUMBERS[code]))
        elif code in _BYTES:
            self._stack.append(self._take(self._number(_BYTES[code])))
        elif code in _TEXTS:
            self._stack.append(self._take(self._number(_TEXTS[code])).decode("utf-8"))
        elif code in _TUPLES:
            self._stack.append(tuple([self._stack.pop() for _ in range(_TUPLES[code])][::-1]))
        elif code in _ACTIONS:
            _ACTIONS[code](self)
        else:
            raise RefusedError(f"has the pickle instruction {code!r} at byte {self._at - 1}, which data does not need")

    def _take(self, count: int) -> bytes:
        if count > len(self._data) - self._at:
            raise EOFError
        self._at += count
        return self._data[self._at - count : self._at]

    def _number(self, layout: str) -> Any:
        return struct.unpack(layout, self._take(struct.calcsize(layout)))[0]

    def _line(self) -> str:
        end = self._data.index(b"\n", self._at, self._at + 256)
        return self._take(end + 1 - self._at)[:-1].decode("utf-8")

    def _pop_to_mark(self) -> list[Any]:
        items = []
        while (item := self._stack.pop()) is not _MARK:
            items.append(item)
        return items[::-1]

    def protocol(self) -> None:
        self._number("<B")

    def frame(self) -> None:
        self._number("<Q")

    def empty_list(self) -> None:
        self._stack.append([])

    def empty_dict(self) -> None:
        self._stack.append({})

    def marked_tuple(self) -> None:
        self._stack.append(tuple(self._pop_to_mark()))

    def put_short(self) -> None:
        self._memo[self._number("<B")] = self._stack[-1]

    def put_long(self) -> None:
        self._memo[self._number("<I")] = self._stack[-1]

    def memoize(self) -> None:
        self._memo[len(self._memo)] = self._stack[-1]

    def get_short(self) -> None:
        self._stack.append(self._memo[self._number("<B")])

    def get_long(self) -> None:
        self._stack.append(self._memo[self._number("<I")])

    def append_one(self) -> None:
        self._append([self._stack.pop()])

    def append_marked(self) -> None:
        self._append(self._pop_to_mark())

    def _append(self, items: list[Any]) -> None:
        if type(self._stack[-1]) is not list:
            raise TypeError
        self._stack[-1].extend(items)

    def set_one(self) -> None:
        value, key = self._stack.pop(), self._stack.pop()
        self._set([key], [value])

    def set_marked(self) -> None:
        items = self._pop_to_mark()
        self._set(items[::2], items[1::2])

    def _set(self, keys: list[Any], values: list[Any]) -> None:
        if type(self._stack[-1]) is not dict:
            raise TypeError
        self._stack[-1].update(zip(map(text, keys), values, strict=True))

    def global_line(self) -> None:
        self._find(self._line(), self._line())

    def global_stack(self) -> None:
        name, module = self._stack.pop(), self._stack.pop()
        self._find(text(module), text(name))

    def _find(self, module: str, name: str) -> None:
        constructor = CONSTRUCTORS.get((module, name))
        if constructor is None:
            raise RefusedError(f"asks for {f'{module}.{name}'[:80]!a}, which is code and no motion")
        self._stack.append(constructor)

    def reduce(self) -> None:
        arguments, function = self._stack.pop(), self._stack.pop()
        if not any(function is constructor for constructor in CONSTRUCTORS.values()):
            raise RefusedError("calls something that is not a constructor of data")
        value = function(*arguments)
        if isinstance(value, bytes):
            self._encoded += len(value)
            if self._encoded > len(self._data):
                raise RefusedError("encodes the same text over and over")
        self._stack.append(value)

    def build(self) -> None:
        state, target = self._stack.pop(), self._stack[-1]
        if not isinstance(target, (Array, Dtype)):
            raise RefusedError("sets attributes of an object")
        target.build(state)


_CONSTANTS: dict[bytes, Any] = {b"N": None, b"\x88": True, b"\x89": False, b")": (), b"(": _MARK}
_NUMBERS = {b"J": "<i", b"K": "<B", b"M": "<H", b"G": ">d"}
_BYTES = {b"C": "<B", b"B": "<I", b"\x8e": "<Q"}
_TEXTS = {b"\x8c": "<B", b"X": "<I", b"\x8d": "<Q"}
_TUPLES = {b"\x85": 1, b"\x86": 2, b"\x87": 3}
_ACTIONS: dict[bytes, Callable[[_Machine], None]] = {
    b"\x80": _Machine.protocol,
    b"\x95": _Machine.frame,
    b"]": _Machine.empty_list,
    b"}": _Machine.empty_dict,
    b"t": _Machine.marked_tuple,
    b"q": _Machine.put_short,
    b"r": _Machine.put_long,
    b"\x94": _Machine.memoize,
    b"h": _Machine.get_short,
    b"j": _Machine.get_long,
    b"a": _Machine.append_one,
    b"e": _Machine.append_marked,
    b"s": _Machine.set_one,
    b"u": _Machine.set_marked,
    b"c": _Machine.global_line,
    b"\x93": _Machine.global_stack,
    b"R": _Machine.reduce,
    b"b": _Machine.build,
}


def _resolve(value: Any, done: dict[int, Any], depth: int) -> Any:
    """The value with arrays in place of their stand-ins; what occurs many times is visited once."""
    if depth > _MAX_DEPTH:
        raise RefusedError("is nested more deeply than a clip")
    if value is _MARK or isinstance(value, Dtype) or callable(value):
        raise RefusedError("holds something that is not data")
    if not isinstance(value, (Array, dict, list, tuple)):
        return value
    if id(value) not in done:
        if isinstance(value, Array):
            done[id(value)] = _resolve(value.value, done, depth + 1)
        elif isinstance(value, dict):
            done[id(value)] = {key: _resolve(item, done, depth + 1) for key, item in value.items()}
        else:
            done[id(value)] = type(value)(_resolve(item, done, depth + 1) for item in value)
    return done[id(value)]
