"""Motion files that no clip can be made of: one line with file, place and cure, exit status 2, nothing written."""

import json
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.conftest import Done
from tests.cli.motion_files import amass, bvh
from tests.cli.refusals import assert_refused

pytest.importorskip("mink", reason="retargeting needs the motion extra: pip install murmillo[motion]")

Murmillo = Callable[..., Done]


class Bomb:
    """Unpickled, it would make a folder."""

    def __reduce__(self) -> Any:
        return os.mkdir, ("exploded",)


def _text(content: str) -> Callable[[Path], object]:
    return lambda file: file.write_text(content, encoding="utf-8")


def _bomb(file: Path) -> None:
    with file.open("wb") as stream:
        np.lib.format.write_array_header_1_0(stream, {"descr": "|O", "fortran_order": False, "shape": ()})
        pickle.dump(Bomb(), stream)


def _npz(**changes: Any) -> Callable[[Path], object]:
    return lambda file: np.savez(file, **amass(**changes))


def _torn_npz(file: Path) -> None:
    np.savez(file, **amass())
    file.write_bytes(file.read_bytes()[:-200])


def _zeros(file: Path) -> None:
    with file.open("wb") as stream:
        stream.truncate(2 * 2**30)


def _with(poses_at: tuple[int, int], value: float) -> np.ndarray:
    poses = amass()["poses"]
    poses[poses_at] = value
    return poses


def _iccgan(frames: list[Any], fps: float = 30) -> str:
    return json.dumps({"fps": fps, "frames": frames})


DEEPMIMIC_FRAME = [
    1 / 30,
    0,
    0.9,
    0,
    *(1, 0, 0, 0) * 4,
    0,
    1,
    0,
    0,
    0,
    1,
    0,
    0,
    0,
    0,
    1,
    0,
    0,
    0,
    0,
    1,
    0,
    0,
    0,
    1,
    0,
    0,
    0,
    0,
]
MOTION = bvh().index("MOTION")

BAD: dict[str, tuple[str, Callable[[Path], object], tuple[str, ...]]] = {
    "pickle that carries code": ("bomb.npy", _bomb, ("mkdir",)),
    "truncated archive": ("torn.npz", _torn_npz, ("torn.npz",)),
    "truncated text": ("torn.bvh", _text(bvh()[: MOTION + 400]), ("Frames: 24",)),
    "NaN": ("nan.npz", _npz(poses=_with((5, 7), np.nan)), ("NaN", "5")),
    "infinity": ("inf.bvh", _text(bvh().replace("93.0000", "inf", 1)), ("frame 0",)),
    "fps of 0": ("still.npz", _npz(mocap_framerate=np.array(0.0)), ("--fps=",)),
    "negative fps": ("back.bvh", _text(bvh(frame_time="-0.0333")), ("Frame Time",)),
    "zero frames": ("empty.bvh", _text(bvh(0)), ("frames",)),
    "quaternion of norm 0": (
        "zero.txt",
        _text(json.dumps({"Loop": "none", "Frames": [[*DEEPMIMIC_FRAME[:4], 0, 0, 0, 0, *DEEPMIMIC_FRAME[8:]]] * 3})),
        ("norm",),
    ),
    "unknown joint names": (
        "odd.bvh",
        _text(bvh(rename={"LeftForeArm": "LeftForeArmm"})),
        ("'LeftForeArm'", "LeftForeArmm"),
    ),
    "BVH with a broken hierarchy": ("open.bvh", _text(bvh().replace("}", "", 3)), ("open.bvh",)),
    "BVH with a wrong channel count": (
        "channels.bvh",
        _text(bvh().replace("CHANNELS 3", "CHANNELS 4", 1)),
        ("CHANNELS",),
    ),
    "AMC without its ASF": ("alone.amc", _text("#!\n:FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 0 0 0 0 0\n"), (".asf",)),
    "a 2 GB file of zeros": ("zeros.npy", _zeros, ("larger than",)),
    "a JSON of something else": ("other.json", _text('{"a": 1}'), ("other.json",)),
    "an unknown format": ("scene.fbx", _text("Kaydara FBX"), (".fbx", ".bvh")),
    "spaces and foreign letters": ("歩く файл 1.bvh", _text("HIERARCHY"), ("歩く файл 1.bvh",)),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_file_is_refused(murmillo: Murmillo, folder: Path, kind: str) -> None:
    name, write, parts = BAD[kind]
    write(folder / name)
    before = sorted(folder.rglob("*"))
    done = murmillo("motions", "import", name, "--to", "clips", "--jobs", "1", "--report", "import.md")
    assert_refused(done, name, *parts)
    assert "murmillo fails on this file" not in done.err
    assert sorted(folder.rglob("*")) == before


def test_many_bad_files_are_all_listed(murmillo: Murmillo, folder: Path) -> None:
    for name in ("a.bvh", "b.bvh"):
        (folder / name).write_text("HIERARCHY")
    done = murmillo("motions", "import", "a.bvh", "b.bvh", "--to", "clips", "--jobs", "1")
    assert done.status == 2
    assert [line[:31] for line in done.err.splitlines()[:2]] == [
        f"murmillo: not imported: {name}.bvh: "[:31] for name in "ab"
    ]
    assert done.err.splitlines()[2] == "murmillo: none of 2 files could be imported"
    assert not (folder / "clips").exists()


def test_skeletons_that_a_given_map_does_not_fit(murmillo: Murmillo, folder: Path) -> None:
    """Mixed skeletons in one folder, where the user says that they are all of one kind."""
    import yaml

    from murmillo.envs.motion.retarget.skeleton_map import shipped_maps

    (mixamo,) = (one for one in shipped_maps() if one.name == "Mixamo")
    (folder / "map.yaml").write_text(yaml.safe_dump({"name": "ours", "points": mixamo.points}))
    (folder / "ours.bvh").write_text(bvh(4))
    np.savez(folder / "theirs.npz", **amass(4))
    done = murmillo("motions", "import", "ours.bvh", "theirs.npz", "--to", "clips", "--map", "map.yaml", "--jobs", "1")
    assert done.status == 0, done.err
    assert done.err.count("\n") == 1
    assert "not imported: theirs.npz" in done.err
    assert "correct the skeleton map" in done.err


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("--to", "clips"), ("PATH",)),
        (("walk.bvh",), ("--to",)),
        (("nowhere", "--to", "clips"), ("nowhere", "no such file or folder")),
        (("empty", "--to", "clips"), ("empty", "holds no motions")),
        (("walk.bvh", "--to", "walk.bvh/clips"), ("walk.bvh/clips", "cannot be written")),
        (("walk.bvh", "--to", "walk.bvh"), ("walk.bvh", "cannot be written")),
        (("walk.bvh", "--to", "."), ("holds other files",)),
        (("walk.bvh", "--to", "clips", "--character", "dragon"), ("dragon", "sword_shield")),
        (("walk.bvh", "--to", "clips", "--up", "x"), ("murmillo: --up=x",)),
        (("walk.bvh", "--to", "clips", "--unit", "elbow"), ("unit=elbow", "cm")),
        (("walk.bvh", "--to", "clips", "--fps", "0"), ("--fps=0",)),
        (("walk.bvh", "--to", "clips", "--fps", "fast"), ("--fps", "fast")),
        (("walk.bvh", "--to", "clips", "--drop-rest", "--keep-rest"), ("--keep-rest", "--drop-rest")),
        (("walk.bvh", "--to", "clips", "--labels", "none.csv"), ("none.csv", "cannot be read")),
        (("walk.bvh", "--to", "clips", "--labels", "from-name", "--rule", "("), ("rule",)),
        (("walk.bvh", "--to", "clips", "--map", "none.yaml"), ("none.yaml", "cannot be read")),
        (("walk.bvh", "--to", "clips", "--jobs", "0"), ("--jobs 0",)),
        (("walk.bvh", "--to", "clips", "--report", "no/import.md"), ("--report no/import.md",)),
        (("walk.bvh", "--to", "clips", "--fsp", "30"), ("--fsp", "--fps")),
    ],
)
def test_mistakes_are_told_before_the_work(
    murmillo: Murmillo, folder: Path, words: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    (folder / "walk.bvh").write_text(bvh(4))
    (folder / "empty").mkdir()
    done = murmillo("motions", "import", *words)
    assert_refused(done, *parts)
    assert sorted(path.name for path in folder.iterdir()) == ["empty", "walk.bvh"]
