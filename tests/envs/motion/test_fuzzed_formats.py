"""Damaged motion files of every format give a recording of finite numbers, or one line: never another error."""

import io
import json
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.asf import read_asf
from murmillo.envs.motion.formats.humanoid import HUMANOID
from murmillo.envs.motion.formats.options import ReadOptions
from murmillo.envs.motion.formats.reader import READERS

MEMORY = 64 * 2**20
"""Files of this test have some kilobytes."""
WORDS = [
    b"",
    b"0",
    b"-1",
    b"1e999",
    b"nan",
    b"999999999999",
    b"1e-320",
    b"}",
    b"{",
    b"[",
    b"]",
    b"null",
    b'"x"',
    b"1_0",
    b"\xff",
]
EDITS = st.lists(
    st.tuples(
        st.sampled_from(["cut", "byte", "drop line", "repeat line", "swap lines", "word", "insert"]),
        st.floats(0.0, 1.0, exclude_max=True),
        st.integers(0, 255),
    ),
    min_size=1,
    max_size=5,
)


def damage(data: bytes, edits: list[tuple[str, float, int]]) -> bytes:
    for edit, place, number in edits:
        at = int(place * len(data))
        lines = data.split(b"\n")
        line = int(place * len(lines))
        words = data.split(b" ")
        match edit:
            case "cut":
                data = data[:at]
            case "byte":
                data = data[:at] + bytes([number]) + data[at + 1 :]
            case "insert":
                data = data[:at] + WORDS[number % len(WORDS)] + data[at:]
            case "drop line":
                data = b"\n".join(lines[:line] + lines[line + 1 :])
            case "repeat line":
                data = b"\n".join(lines[: line + 1] * 2 + lines[line + 1 :])
            case "swap lines":
                other = number % len(lines)
                lines[line], lines[other] = lines[other], lines[line]
                data = b"\n".join(lines)
            case "word":
                words[int(place * len(words))] = WORDS[number % len(WORDS)]
                data = b" ".join(words)
    return data


BVH = b"""HIERARCHY
ROOT World
{ OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Hips
  { OFFSET 0 9 0
    CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
    JOINT Head
    { OFFSET 0 60 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site { OFFSET 0 10 0 }
    }
    JOINT LeftLeg
    { OFFSET 9 -45 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      JOINT LeftFoot { OFFSET 0 -45 0 CHANNELS 0 }
    }
    JOINT RightLeg
    { OFFSET -9 -45 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      JOINT RightFoot { OFFSET 0 -45 0 CHANNELS 0 }
    }
  }
}
MOTION
Frames: 4
Frame Time: 0.0333333
0 0 0 0 0 0 0 90 0 0 0 0 0 0 0 20 0 0 0 10 0
0 0 0 0 0 0 1 90 0 0 0 0 0 0 0 30 0 0 0 20 0
0 0 0 0 0 0 2 90 0 0 0 0 0 0 0 40 0 0 0 30 0
0 0 0 0 0 0 3 90 0 0 0 0 0 0 0 50 0 0 0 40 0
"""
ASF = b"""# asf
:units
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    name ltibia
    direction 0 -1 0
    length 9
    axis 0 0 20 XYZ
    dof rx ry rz
  end
  begin
    name head
    direction 0 1 0
    length 9
    axis 0 0 0 XYZ
    dof rz
  end
:hierarchy
  begin
    root ltibia head
  end
"""
AMC = b":FULLY-SPECIFIED\n:DEGREES\n" + b"".join(
    b"%d\nroot 0 17 0 1 2 3\nltibia 4 5 %d\nhead 6\n" % (i, i) for i in range(1, 5)
)


def deepmimic() -> bytes:
    frame = [0.03, 0.0, 0.9, 0.0, *[1.0, 0.0, 0.0, 0.0] * 4, 0.0, *[1.0, 0.0, 0.0, 0.0] * 2, 0.0]
    frame += [1.0, 0.0, 0.0, 0.0, 0.0, *[1.0, 0.0, 0.0, 0.0] * 2, 0.0]
    return json.dumps({"Loop": "none", "Frames": [frame] * 3}).replace("],", "],\n").encode()


def iccgan() -> bytes:
    frame: dict[str, object] = {link: [0.0, 0.0, 0.0, 1.0] for link in HUMANOID.names}
    frame["pelvis"] = [[0.0, 0.0, 0.9], [0.0, 0.0, 0.0, 1.0]]
    return json.dumps({"fps": 30, "frames": [frame] * 3}).replace("],", "],\n").encode()


def amass() -> bytes:
    """Uncompressed, so that edits reach the headers and the numbers."""
    file = io.BytesIO()
    poses = np.full((3, 66), 0.1)
    np.savez(file, poses=poses, trans=np.zeros((3, 3)), mocap_framerate=np.array(60.0))
    return file.getvalue()


@pytest.fixture
def seeds(poselib_motion, save_poselib) -> dict[str, bytes]:
    """A small sound file of each format, by suffix."""
    return {
        ".amc": AMC,
        ".bvh": BVH,
        ".json": iccgan(),
        ".npy": save_poselib(poselib_motion),
        ".npz": amass(),
        ".txt": deepmimic(),
    }


def read_or_one_line(read: Callable[[], Any]) -> Any:
    """What is read, or None where a line says why not; memory is watched."""
    result, line = None, ""
    tracemalloc.start()
    try:
        result = read()
    except MotionError as error:
        line = str(error)
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < MEMORY
    assert "\n" not in line
    assert len(line) < 600
    return result


def check(data: bytes, file: Path) -> bool:
    """Whether it could be read."""
    recording = read_or_one_line(lambda: READERS[file.suffix](data, file, ReadOptions()))
    if recording is None:
        return False
    assert recording.frames >= 2
    assert np.isfinite(recording.fps)
    assert recording.fps > 0.0
    pos, quat = recording.global_pose()
    assert np.isfinite(pos).all()
    np.testing.assert_allclose(np.linalg.norm(quat, axis=-1), 1.0, atol=1e-6)
    names = recording.skeleton.names
    assert len(set(names)) == len(names) == len(recording.skeleton.parents) == quat.shape[1]
    return True


def test_the_seeds_are_sound(seeds, tmp_path):
    (tmp_path / "clip.asf").write_bytes(ASF)
    assert set(seeds) == set(READERS)
    for suffix, data in seeds.items():
        assert check(data, tmp_path / f"clip{suffix}"), suffix


@pytest.mark.parametrize("suffix", sorted(READERS))
@settings(max_examples=80, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(edits=EDITS)
def test_damaged_small_files(seeds, tmp_path, suffix, edits):
    (tmp_path / "clip.asf").write_bytes(ASF)
    check(damage(seeds[suffix], edits), tmp_path / f"clip{suffix}")


@settings(
    max_examples=100, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(edits=EDITS)
def test_damaged_skeletons(tmp_path, edits):
    damaged = damage(ASF, edits)
    if read_or_one_line(lambda: read_asf(damaged, Path("clip.asf"))) is not None:
        (tmp_path / "clip.asf").write_bytes(damaged)
        check(AMC, tmp_path / "clip.amc")


@pytest.mark.parametrize("suffix", sorted(READERS))
def test_truncated_files(seeds, tmp_path, suffix):
    """At every twentieth of its length; a text that has lost no more than blanks is still sound."""
    (tmp_path / "clip.asf").write_bytes(ASF)
    data = seeds[suffix].rstrip() if suffix != ".npy" else seeds[suffix]
    sound = [check(data[: len(data) * part // 20], tmp_path / f"clip{suffix}") for part in range(20)]
    if suffix == ".amc":  # nothing in it says how many frames it has
        assert sum(sound) < 4
    else:
        assert not any(sound)


REAL = {
    ".amc": "cmu_asf_amc/02_03.amc",
    ".bvh": "bandai_namco_bvh/dataset-1_bow_active_001.bvh",
    ".json": "walk_run_lafan1/iccgan/stoop_walk.json",
    ".npy": "sword_shield_ase/amp_humanoid_walk.npy",
    ".txt": "deepmimic/humanoid3d_run.txt",
}


@pytest.mark.parametrize("suffix", sorted(REAL))
@settings(max_examples=10, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(edits=EDITS)
def test_damaged_recordings(shared_motions, suffix, edits):
    file = shared_motions / REAL[suffix]
    check(damage(file.read_bytes(), edits), file)
