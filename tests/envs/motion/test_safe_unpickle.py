"""Pickles of data are read as Python reads them; any that ask for more are refused, and nothing of them is run."""

import os
import pickle
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.safe_unpickle import read_pickle


class Call:
    """Pickles as a call of a function."""

    def __init__(self, function, *arguments):
        self.call = (function, arguments)

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize("protocol", [2, 3, 4])
def test_reads_data_as_python_does(protocol):
    data: OrderedDict[str, Any] = OrderedDict(
        numbers=np.arange(12.0).reshape(3, 4),
        big_endian=np.array([1, 2], dtype=">i4"),
        flags=np.array([True, False]),
        single=np.array([1.5], dtype=np.float32),
        rate=np.float64(29.9),
        rest={"text": ["straße", -5, 300, 70000, 2.5, None, True, (1, (2, 3, 4), ())], "bytes": b"\x00\xff"},
    )
    read = read_pickle(pickle.dumps(data, protocol), "clip.npy")
    assert list(read) == list(data)
    for key in ("numbers", "big_endian", "flags", "single"):
        assert read[key].dtype == data[key].dtype
        assert np.array_equal(read[key], data[key])
    assert read["rate"] == 29.9
    assert read["rest"] == data["rest"]


def test_what_occurs_twice_is_one_thing():
    shared = np.arange(3.0)
    first, second = read_pickle(pickle.dumps([shared, shared], 3), "clip.npy")
    assert first is second


@pytest.mark.parametrize("protocol", [2, 3, 4])
@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        (os.system, ("touch {marker}",)),
        (eval, ("open({marker!r}, 'w').close()",)),
        (exec, ("open({marker!r}, 'w').close()",)),
        (os.mkdir, ("{marker}",)),
        (Path.touch, (Path("{marker}"),)),
        (np.savetxt, ("{marker}", [1.0])),
    ],
)
def test_calls_are_refused_by_name_and_do_not_run(tmp_path, function, arguments, protocol):
    marker = tmp_path / "marker"
    filled = [type(a)(str(a).format(marker=str(marker))) if isinstance(a, (str, Path)) else a for a in arguments]
    pickled = pickle.dumps({"fps": 30.0, "rotation": Call(function, *filled)}, protocol)
    with pytest.raises(
        MotionError, match=r"clip\.npy: asks for '.*', which is code and no motion; nothing of it was run"
    ):
        read_pickle(pickled, "clip.npy")
    assert not marker.exists()
    pickle.loads(pickled)
    assert marker.exists(), "the pickle should have been dangerous"


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("numpy", "fromfile"),
        ("numpy", "load"),
        ("numpy.core.multiarray", "fromfile"),
        ("numpy._core.multiarray", "_reconstruct.__globals__"),
        ("numpy", "ndarray.tofile"),
        ("builtins", "getattr"),
        ("functools", "partial"),
        ("collections", "OrderedDict.fromkeys"),
        ("_codecs", "decode"),
        ("murmillo.envs.motion", "load_clips"),
    ],
)
def test_neighbours_of_what_is_known_are_refused(module, name):
    old = f"c{module}\n{name}\n.".encode()
    new = b"".join(b"\x8c" + bytes([len(text)]) + text.encode() for text in (module, name)) + b"\x93."
    for pickled in (old, b"\x80\x04" + new):
        with pytest.raises(MotionError, match="which is code and no motion"):
            read_pickle(pickled, "clip.npy")


@pytest.mark.parametrize(
    "pickled",
    [
        b"(S'touch marker'\nios\nsystem\n.",  # INST
        b"\x80\x02]\x82\x01.",  # EXT1
        b"\x80\x02}Pid\n.",  # PERSID
        b"\x80\x02cnumpy\nndarray\n)\x81.",  # NEWOBJ
        b"\x80\x02(cnumpy\nndarray\no.",  # OBJ
        b"\x80\x02]2.",  # DUP
        b"I" + b"9" * 10_000 + b"\n.",  # INT of ten thousand digits
        b"\x80\x05\x96" + b"\xff" * 8 + b".",  # BYTEARRAY8
    ],
)
def test_instructions_that_data_does_not_need_are_refused(pickled):
    with pytest.raises(MotionError, match="pickle instruction"):
        read_pickle(pickled, "clip.npy")


@pytest.mark.parametrize(
    "pickled",
    [
        b"",
        b".",
        b"\x80\x02]",
        b"\x80\x02]].",  # two results
        b"\x80\x02(.",  # a mark
        b"\x80\x02cnumpy\ndtype\n.",  # a constructor
        b"\x80\x02cnumpy\ndtype\nX\x02\x00\x00\x00f8\x85R.",  # a type
        b"\x80\x02]}b.",  # attributes of a list
        b"\x80\x02]]R.",  # a call of a list
        b"\x80\x02}K\x01K\x02s.",  # a key that is no text
        b"\x80\x02]h\x07.",  # an unknown memo
        b"\x80\x02B\xff\xff\xff\xff.",  # four gigabytes that are not there
        b"\x80\x02" + b"]" * 50 + b"a" * 49 + b".",  # nested fifty times
        b"\x80\x02]q\x00h\x00a.",  # a list that holds itself
        b"]" * 200_000,
    ],
)
def test_damaged_programs_end_in_one_line(pickled):
    with pytest.raises(MotionError) as caught:
        read_pickle(pickled, "clip.npy")
    assert "\n" not in str(caught.value)


def test_an_array_must_have_the_numbers_it_claims():
    pickled = pickle.dumps(np.arange(6.0), 3)
    with pytest.raises(MotionError, match="cut short or damaged"):
        read_pickle(pickled.replace(b"K\x06\x85", b"K\x07\x85"), "clip.npy")
    with pytest.raises(MotionError, match="values of type 'V9'"):
        read_pickle(pickled.replace(b"f8", b"V9"), "clip.npy")


def test_a_small_file_cannot_become_a_large_structure():
    """Twelve lists, each a thousand times the one before: 10^36 items if they were visited one by one."""
    levels = [b"]q\x00"] + [
        b"](" + b"h" + bytes([i]) + (b"h" + bytes([i])) * 999 + b"eq" + bytes([i + 1]) for i in range(12)
    ]
    pickled = b"\x80\x02(" + b"".join(levels) + b"l."
    with pytest.raises(MotionError, match="pickle instruction"):  # LIST, which protocol 2 no longer writes
        read_pickle(pickled, "clip.npy")
    read = read_pickle(b"\x80\x02(" + b"".join(levels) + b"t.", "clip.npy")
    assert read[1][0] is read[1][999]
    assert len(read) == 13


def test_a_small_file_cannot_become_many_bytes():
    """A text of 1 MB that is to be turned into bytes fifteen thousand times."""
    text, encode = b"X" + (2**20).to_bytes(4, "little") + b"a" * 2**20 + b"q\x00", b"c_codecs\nencode\nq\x01"
    again = b"h\x01h\x00X\x06\x00\x00\x00latin1\x86R"
    with pytest.raises(MotionError, match="over and over"):
        read_pickle(b"\x80\x02(" + text + encode + again * 15_000 + b"t.", "clip.npy")
