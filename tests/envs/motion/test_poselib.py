"""poselib files: conversion by hand-made numbers, the 87 clips of ASE, and files as they should not be."""

import pickle
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from murmillo.envs.errors import MotionError
from murmillo.envs.motion import Clip, load_clips
from murmillo.envs.motion.formats.npy import split_npy
from murmillo.envs.motion.formats.options import ReadOptions
from murmillo.envs.motion.formats.poselib import read_poselib, read_poselib_recording
from murmillo.envs.motion.formats.safe_unpickle import read_pickle
from murmillo.envs.motion.velocities import clip_velocities
from murmillo.envs.rotations import quat_rotate

FILE = Path("RL_Avatar_Bend_Motion.npy")


def test_rotations_become_mujocos(character, poselib_motion, save_poselib):
    clip = read_poselib(save_poselib(poselib_motion), FILE, character, weight=0.3)
    assert (clip.name, clip.label, clip.fps, clip.weight) == ("Bend", "Bend", 29.9, 0.3)
    assert (clip.licence, clip.redistributable) == ("Reallusion, noncommercial", False)
    pose = clip.qpos[4]
    joints = {joint.name: pose[joint.qpos] for joint in character.joints}
    np.testing.assert_allclose(pose[:7], [1.0, 2.0, 0.9, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(joints["right_elbow"], [-0.4])
    np.testing.assert_allclose(joints["left_elbow"], [0.0])
    np.testing.assert_allclose(joints["abdomen"], [np.cos(0.4), 0.0, 0.0, np.sin(0.4)])
    np.testing.assert_allclose(joints["neck"], [1.0, 0.0, 0.0, 0.0])


def test_any_skeleton_is_read_as_a_recording(character, poselib_motion, save_poselib):
    poselib_motion["skeleton_tree"]["local_translation"]["arr"][0] = 7.0  # where the root rests does not matter
    recording = read_poselib_recording(save_poselib(poselib_motion), FILE, ReadOptions())
    assert (recording.name, recording.fps, recording.findings["unit"]) == ("Bend", 29.9, "m (format)")
    assert (recording.licence, recording.redistributable) == ("Reallusion, noncommercial", False)
    skeleton = recording.skeleton
    assert (skeleton.names, skeleton.parents) == (character.bodies, tuple(character.model.body_parentid[1:] - 1))
    np.testing.assert_array_equal(skeleton.offsets[0], 0.0)
    np.testing.assert_allclose(skeleton.offsets[1:], character.model.body_pos[2:], atol=1e-6)
    np.testing.assert_allclose(recording.root_pos_w, np.tile([1.0, 2.0, 0.9], (5, 1)))
    elbow = recording.quat[4, character.bodies.index("right_lower_arm")]
    np.testing.assert_allclose(elbow, [np.cos(0.2), 0.0, -np.sin(0.2), 0.0])


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda m: m["skeleton_tree"].pop("node_names"), "node_names is missing"),
        (lambda m: m["skeleton_tree"]["node_names"].__setitem__(1, "pelvis"), "no names, or the same twice"),
        (lambda m: m["skeleton_tree"]["parent_indices"]["arr"].__setitem__(3, 4), "a joint comes before its parent"),
        (lambda m: m["skeleton_tree"]["parent_indices"]["arr"].__setitem__(0, 0), "a joint comes before its parent"),
        (lambda m: m["rotation"]["arr"].__setitem__((2, 5, 1), np.nan), r"rotation.arr\[2\] has a NaN"),
        (lambda m: m.pop("fps"), r"fps is missing; tell .* fps= \(--fps\)"),
    ],
)
def test_recordings_that_are_wrong(poselib_motion, save_poselib, refuses, spoil, reason):
    spoil(poselib_motion)
    refuses(lambda: read_poselib_recording(save_poselib(poselib_motion), FILE, ReadOptions()), reason, f"{FILE}: ")


@pytest.mark.parametrize("protocol", [2, 3, 4])
def test_reads_every_way_that_numpy_writes(character, poselib_motion, save_poselib, npy_of, protocol):
    wanted = read_poselib(save_poselib(poselib_motion), FILE, character)
    pickled = pickle.dumps(np.array(poselib_motion, dtype=object), protocol)
    clips = [read_poselib(npy_of(pickled), FILE, character)]
    if protocol < 4:  # names are lines there: as numpy 1 and as numpy 2 write them
        for old, new in [(b"numpy._core", b"numpy.core"), (b"numpy.core", b"numpy._core")]:
            clips.append(read_poselib(npy_of(pickled.replace(old, new)), FILE, character))
    for clip in clips:
        assert np.array_equal(clip.qpos, wanted.qpos)


def test_order_of_bodies_in_the_file_does_not_matter(character, poselib_motion, save_poselib):
    wanted = read_poselib(save_poselib(poselib_motion), FILE, character)
    order = np.random.default_rng(0).permutation(len(character.bodies))
    tree = poselib_motion["skeleton_tree"]
    parents = tree["parent_indices"]["arr"][order]
    tree["node_names"] = [tree["node_names"][i] for i in order]
    tree["parent_indices"]["arr"] = np.array([-1 if parent < 0 else list(order).index(parent) for parent in parents])
    tree["local_translation"]["arr"] = tree["local_translation"]["arr"][order]
    poselib_motion["rotation"]["arr"] = poselib_motion["rotation"]["arr"][:, order]
    assert np.array_equal(read_poselib(save_poselib(poselib_motion), FILE, character).qpos, wanted.qpos)


def elbow_twist(motion, angle):
    motion["rotation"]["arr"][3, 4] = [np.sin(angle / 2), 0.0, 0.0, np.cos(angle / 2)]


SPOILERS = {
    "fps 0": (lambda m: m.update(fps=0.0), "fps is 0"),
    "no fps": (lambda m: m.pop("fps"), "fps is missing"),
    "global rotations": (lambda m: m.update(is_local=False), "is_local"),
    "NaN": (lambda m: m["rotation"]["arr"].__setitem__((2, 5, 1), np.nan), r"rotation.arr\[2\] has a NaN"),
    "infinite root": (lambda m: m["root_translation"]["arr"].__setitem__((1, 0), np.inf), r"root_translation.arr\[1\]"),
    "no unit": (lambda m: m["rotation"]["arr"].__setitem__((1, 6), 0.0), "frame 1, sword: its quaternion has norm 0"),
    "short root": (lambda m: m["root_translation"].update(arr=np.zeros((4, 3))), r"has the shape \[4, 3\]"),
    "one frame": (
        lambda m: [m[key].update(arr=m[key]["arr"][:1]) for key in ("rotation", "root_translation")],
        "at least 2",
    ),
    "no frames": (
        lambda m: [m[key].update(arr=m[key]["arr"][:0]) for key in ("rotation", "root_translation")],
        "has no frames",
    ),
    "no rotation": (lambda m: m.pop("rotation"), "rotation.arr is missing"),
    "rotation is text": (lambda m: m.update(rotation={"arr": "none"}), "rotation.arr is missing"),
    "other names": (
        lambda m: m["skeleton_tree"]["node_names"].__setitem__(6, "spear"),
        r"another skeleton than sword_shield \(lacks sword; has besides 'spear'\)",
    ),
    "other parents": (lambda m: m["skeleton_tree"]["parent_indices"]["arr"].__setitem__(9, 0), "the parent of shield"),
    "centimetres": (lambda m: m["skeleton_tree"]["local_translation"]["arr"].__imul__(100.0), "100 times the size"),
    "bent hinge": (lambda m: elbow_twist(m, 0.5), "frame 3, right_lower_arm turns 29 degrees about an axis"),
    "loose shield": (
        lambda m: m["rotation"]["arr"].__setitem__((4, 9), [0.0, np.sin(0.1), 0.0, np.cos(0.1)]),
        "frame 4, shield turns 11 degrees",
    ),
}


@pytest.mark.parametrize("spoiler", SPOILERS)
def test_names_what_is_wrong_and_where(character, poselib_motion, save_poselib, refuses, spoiler):
    spoil, reason = SPOILERS[spoiler]
    spoil(poselib_motion)
    refuses(lambda: read_poselib(save_poselib(poselib_motion), FILE, character), reason, "")


@pytest.mark.parametrize(
    "content",
    [b"", b"{}", b"\x93NUMPY", b"\x93NUMPY\x01\x00\xff\xff{", b"\x93NUMPY\x09\x00\x10\x00", b"\x93NUMPY\x01\x00"],
)
def test_refuses_what_is_no_npy_file(character, content):
    with pytest.raises(MotionError, match=r"^RL_Avatar_Bend_Motion\.npy: "):
        read_poselib(content, FILE, character)


def test_refuses_an_array_that_is_no_motion(character, save_poselib):
    for data in (save_poselib([1.0, 2.0]), save_poselib("text")):
        with pytest.raises(MotionError, match="no poselib motion"):
            read_poselib(data, FILE, character)


def test_truncated_files_are_refused(character, poselib_motion, save_poselib):
    data = save_poselib(poselib_motion)
    for part in range(20):
        with pytest.raises(MotionError):
            read_poselib(data[: len(data) * part // 20], FILE, character)


@settings(
    max_examples=300, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(edits=st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.binary(max_size=3)), min_size=1, max_size=8))
def test_damaged_files_give_a_clip_or_one_line(character, poselib_motion, save_poselib, edits):
    data = save_poselib(poselib_motion)
    for place, replacement in edits:
        at = int(place * len(data))
        data = data[:at] + replacement + data[at + 1 :]
    try:
        qpos = read_poselib(data, FILE, character).qpos
    except MotionError as error:
        message, qpos = str(error), np.zeros(1)
        assert "\n" not in message
    assert np.isfinite(qpos).all()


# the recordings


@pytest.fixture(scope="module")
def clips(recordings, character) -> list[Clip]:
    return load_clips(recordings, character)


def raw(recordings: Path, clip: Clip) -> dict:
    data = (recordings / f"RL_Avatar_{clip.name}_Motion.npy").read_bytes()
    return read_pickle(split_npy(data, clip.name)[2], clip.name)


def test_the_folder_gives_the_dataset(clips):
    assert len(clips) == 87
    assert sum(clip.frames for clip in clips) == 11_488
    assert sum(clip.duration for clip in clips) == pytest.approx(380.28, abs=0.01)
    assert sum(clip.weight for clip in clips) == pytest.approx(1.0, abs=1e-6)
    weights = {clip.name: clip.weight for clip in clips}
    assert weights["Standoff_Circle"] == pytest.approx(0.062112, abs=1e-6)
    assert not any(clip.redistributable for clip in clips)
    assert Counter(clip.qpos.tobytes() for clip in clips).most_common(4)[3][1] == 1  # three clips are there twice


def test_clips_of_the_other_humanoid_are_refused(recordings, character):
    with pytest.raises(
        MotionError, match=r"amp_humanoid_walk\.npy: is a motion of another skeleton.*lacks sword, shield"
    ):
        load_clips(recordings / "amp_humanoid_walk.npy", character)


def matrices(quat_xyzw: np.ndarray) -> np.ndarray:
    """Rotation matrices [..., 3, 3] by the textbook, independent of the package's quaternions."""
    x, y, z, w = np.moveaxis(quat_xyzw, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def test_forward_kinematics_equals_the_files_own(clips, recordings, character):
    for clip in clips:
        motion = raw(recordings, clip)
        tree, local = motion["skeleton_tree"], matrices(motion["rotation"]["arr"])
        pos, rot = [motion["root_translation"]["arr"]], [local[:, 0]]
        for body in range(1, 17):
            parent, offset = tree["parent_indices"]["arr"][body], tree["local_translation"]["arr"][body]
            pos.append(pos[parent] + rot[parent] @ offset)
            rot.append(rot[parent] @ local[:, body])
        body_pos_w, body_quat_w = character.forward_kinematics(torch.tensor(clip.qpos))
        np.testing.assert_allclose(body_pos_w.numpy(), np.stack(pos, axis=1), atol=1e-6, err_msg=clip.name)
        ours = matrices(np.roll(body_quat_w.numpy(), -1, axis=-1))
        np.testing.assert_allclose(ours, np.stack(rot, axis=1), atol=1e-6, err_msg=clip.name)


def test_root_velocities_equal_the_stored_ones(clips, recordings, character):
    """Linear ones to 1e-5 m/s (measured: 6e-6). Angular ones to 0.02 rad/s (measured: 0.008): the files' are consistent
    with an arc cosine in single precision, which cannot tell turns below 3e-4 rad, 0.01 rad/s at 30 Hz, from none."""
    for clip in clips:
        motion, qpos = raw(recordings, clip), torch.tensor(clip.qpos)
        qvel = clip_velocities(character, qpos, clip.fps)
        stored = (
            torch.tensor(motion["global_velocity"]["arr"][:, 0]),
            torch.tensor(motion["global_angular_velocity"]["arr"][:, 0]),
        )
        torch.testing.assert_close(qvel[:, 0:3], stored[0], atol=1e-5, rtol=0.0, msg=clip.name)
        angular_w = quat_rotate(qpos[:, 3:7], qvel[:, 3:6])
        torch.testing.assert_close(angular_w, stored[1], atol=0.02, rtol=0.0, msg=clip.name)


def test_hinges_and_fixed_bodies_lose_no_rotation(clips, recordings, character):
    """What the four hinges and the three fixed bodies of the recordings turn about other axes is rounding."""
    hinges, fixed = ("right_lower_arm", "left_lower_arm", "right_shin", "left_shin"), ("sword", "shield", "left_hand")
    for clip in clips:
        rotation = raw(recordings, clip)["rotation"]["arr"]
        off_axis = rotation[:, [character.bodies.index(name) for name in hinges]][..., [0, 2]]
        assert np.abs(off_axis).max() < 1e-12
        assert np.abs(rotation[:, [character.bodies.index(name) for name in fixed]][..., :3]).max() < 1e-12
