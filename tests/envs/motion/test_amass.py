"""AMASS and SMPL motions: kinematics by hand, all layouts, and archives as they should not be."""

import io
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.amass import read_amass
from murmillo.envs.motion.formats.options import ReadOptions

FILE = Path("amass_poses.npz")
FRAMES = 20


def arrays(columns: int = 156) -> dict[str, np.ndarray]:
    """A body upright in z-up axes, as AMASS has them, that bends its left knee a little more each frame."""
    poses = np.zeros((FRAMES, columns))
    poses[:, 0] = np.pi / 2.0  # SMPL's y up becomes z up
    poses[:, 12] = np.linspace(0.1, 1.0, FRAMES)
    poses[:, 15] = 0.1
    return {
        "poses": poses,
        "trans": np.tile([0.0, 0.0, 0.95], (FRAMES, 1)),
        "betas": np.zeros(16),
        "gender": np.array("neutral"),
        "mocap_framerate": np.array(120.0),
    }


def save(content: dict[str, np.ndarray], compressed: bool = True) -> bytes:
    file = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(file, **content)  # type: ignore[arg-type]  # names are any text
    return file.getvalue()


def read(data: bytes, options: ReadOptions | None = None):
    return read_amass(data, FILE, options or ReadOptions())


def test_stands_upright_and_bends_the_knee_back():
    recording = read(save(arrays()))
    assert (recording.frames, recording.fps) == (FRAMES, 120.0)
    assert recording.findings["left, right"] == "as named (measured)"
    assert recording.findings["up"] == "z (format)"
    names = recording.skeleton.names
    pos, quat = recording.global_pose()
    at = {name: pos[-1, names.index(name)] for name in names}
    np.testing.assert_allclose(at["pelvis"], [-0.0022, -0.2408, 0.9786])
    assert at["head"][2] - at["pelvis"][2] > 0.55
    assert at["left_hip"][0] > at["right_hip"][0] + 0.1  # faces -y
    # the thigh hangs as it is; the shin, bent by 1 rad about x, comes to -y cos + z sin: backwards is +y
    thigh = at["pelvis"] + [0.0586, 0.0177, -0.0823] + np.array([0.0435, -0.0080, -0.3865])
    np.testing.assert_allclose(at["left_knee"], thigh, atol=1e-12)
    shin = [-0.0148, 0.4269 * np.sin(1.0) + 0.0374 * np.cos(1.0), -0.4269 * np.cos(1.0) + 0.0374 * np.sin(1.0)]
    np.testing.assert_allclose(at["left_ankle"], thigh + shin, atol=1e-12)
    np.testing.assert_allclose(quat[-1, 0], [1.0, 0.0, 0.0, 0.0], atol=1e-12)  # upright is the frame's rest


def test_all_layouts_give_the_same_body():
    wanted = read(save(arrays())).quat
    poses = arrays()["poses"]
    for columns in (66, 72, 165):
        np.testing.assert_allclose(read(save(arrays(columns))).quat, wanted)
    split = arrays() | {"root_orient": poses[:, :3], "pose_body": poses[:, 3:66]}
    del split["poses"]
    split["mocap_frame_rate"] = split.pop("mocap_framerate")
    np.testing.assert_allclose(read(save(split)).quat, wanted)
    np.testing.assert_allclose(read(save(arrays(), compressed=False)).quat, wanted)
    np.testing.assert_allclose(read(save(arrays() | {"poses": poses.astype(np.float32)})).quat, wanted, atol=1e-6)


def test_an_array_of_objects_that_is_not_needed_is_not_looked_at():
    assert read(save(arrays() | {"labels": np.array([object], dtype=object)})).frames == FRAMES


def without(name: str) -> bytes:
    content = arrays()
    del content[name]
    return save(content)


def edited(name: str, value: np.ndarray) -> bytes:
    return save(arrays() | {name: value})


def nan_pose() -> np.ndarray:
    poses = arrays()["poses"]
    poses[3, 7] = np.nan
    return poses


SPOILED = {
    "nothing": (b"", "is no .npz archive"),
    "cut short": (save(arrays())[:-30], "is no .npz archive"),
    "no poses": (without("poses"), "neither poses nor root_orient"),
    "no trans": (without("trans"), "trans is missing"),
    "no rate": (without("mocap_framerate"), "mocap_framerate is missing"),
    "rate 0": (edited("mocap_framerate", np.array(0.0)), "fps is 0"),
    "rate of two": (edited("mocap_framerate", np.array([30.0, 60.0])), "mocap_framerate is missing"),
    "short trans": (edited("trans", np.zeros((3, 3))), r"trans is \[3, 3\] and not \[20, 3\]"),
    "other layout": (edited("poses", np.zeros((FRAMES, 69))), r"poses are \[20, 69\]; known are"),
    "flat": (edited("poses", np.zeros(156)), r"poses are \[156\]"),
    "NaN": (edited("poses", nan_pose()), "rotations: frame 3 has a NaN"),
    "infinite": (edited("trans", np.full((FRAMES, 3), np.inf)), "frame 0, root position: has a NaN, an infinity"),
    "objects": (edited("poses", np.array([object], dtype=object)), r"poses: holds values of type '\|O'"),
    "text": (edited("poses", np.array(["a", "b"])), "poses: holds values of type '<U1'"),
    "no frames": (save(arrays() | {"poses": np.zeros((0, 156)), "trans": np.zeros((0, 3))}), "has 0 frames"),
}


@pytest.mark.parametrize("spoiled", SPOILED)
def test_names_what_is_wrong(refuses, spoiled):
    data, reason = SPOILED[spoiled]
    refuses(lambda: read(data), reason, "amass_poses.npz: ")


def test_told_rate_mends_a_missing_one():
    assert read(without("mocap_framerate"), ReadOptions(fps=60.0)).fps == 60.0


def archive_of(content: bytes, kind: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", kind) as archive:
        archive.writestr("poses.npy", content)
    return file.getvalue()


def test_a_small_archive_does_not_become_a_large_array():
    bomb = archive_of(bytes(2**27 + 1))
    assert len(bomb) < 2**18
    modest = bomb.replace((2**27 + 1).to_bytes(4, "little"), (1000).to_bytes(4, "little"))
    tracemalloc.start()
    try:
        with pytest.raises(MotionError, match="poses is larger than 128 MB"):
            read(bomb)
        with pytest.raises(MotionError, match=r"is no \.npz archive"):  # it says that it holds a thousand bytes
            read(modest)
        assert tracemalloc.get_traced_memory()[1] < 2**23
    finally:
        tracemalloc.stop()


def test_other_packings_and_crowds_are_refused():
    with pytest.raises(MotionError, match=r"is no \.npz archive"):
        read(archive_of(bytes(1000), zipfile.ZIP_LZMA))
    with pytest.raises(MotionError, match="more than 1000 arrays"):
        read(b"PK\x01\x02" * 1001)
