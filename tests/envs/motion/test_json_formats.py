"""DeepMimic's and ICCGAN's clips: kinematics by hand, real clips, and files as they should not be."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from murmillo.envs.motion.formats.deepmimic import read_deepmimic
from murmillo.envs.motion.formats.humanoid import DEEPMIMIC, HUMANOID
from murmillo.envs.motion.formats.iccgan import read_iccgan
from murmillo.envs.motion.formats.options import ReadOptions

FILE = Path("clip")
HALF = np.sqrt(0.5)


def row(duration: float = 0.033332, **joints: list[float]) -> list[float]:
    """A frame that stands at rest at (1, 2, 3), but for these joints."""
    values = {"root": [1.0, 0.0, 0.0, 0.0]}
    for name in DEEPMIMIC.names[1:]:
        if "wrist" not in name:
            values[name] = [0.0] if "knee" in name or "elbow" in name else [1.0, 0.0, 0.0, 0.0]
    order = "root chest neck right_hip right_knee right_ankle right_shoulder right_elbow left_hip left_knee left_ankle "
    order += "left_shoulder left_elbow"
    return [duration, 1.0, 2.0, 3.0, *(number for name in order.split() for number in (values | joints)[name])]


def deepmimic(rows: Any, options: ReadOptions | None = None, **more: Any):
    return read_deepmimic(json.dumps({"Loop": "wrap", "Frames": rows} | more).encode(), FILE, options or ReadOptions())


def iccgan(frames: Any, options: ReadOptions | None = None, **more: Any):
    return read_iccgan(json.dumps({"fps": 30, "frames": frames} | more).encode(), FILE, options or ReadOptions())


def place(recording, name: str) -> np.ndarray:
    return recording.global_pose()[0][0, recording.skeleton.names.index(name)]


def test_deepmimic_by_hand():
    """y up becomes z up. The right knee bends back by 90 degrees, the right elbow ahead, the left hip straddles."""
    recording = deepmimic([row(right_knee=[-np.pi / 2], right_elbow=[np.pi / 2], left_hip=[HALF, HALF, 0, 0])] * 2)
    assert (recording.fps, recording.loop) == (30.0, True)
    np.testing.assert_allclose(place(recording, "root"), [1, -3, 2], atol=1e-12)
    np.testing.assert_allclose(place(recording, "chest"), [1, -3, 2.236151], atol=1e-12)
    np.testing.assert_allclose(place(recording, "right_ankle"), [1 - 0.409870, -3.084887, 2 - 0.421546], atol=1e-12)
    wrist = [1 - 0.02405 + 0.258947, -3.18311, 2 + 0.236151 + 0.24350 - 0.274788]
    np.testing.assert_allclose(place(recording, "right_wrist"), wrist, atol=1e-12)
    np.testing.assert_allclose(place(recording, "left_ankle"), [1, -2.915113 + 0.831416, 2], atol=1e-12)


def test_deepmimic_frames_of_unequal_duration_are_resampled():
    """The second frame lasts twice as long as the others: a frame is put into its middle."""
    turn = [[np.cos(angle / 2), 0, np.sin(angle / 2), 0] for angle in (0.0, 0.1, 0.3, 0.4)]
    durations = [0.033332, 0.066664, 0.033332, 0.0]
    recording = deepmimic([row(duration, chest=quat) for duration, quat in zip(durations, turn, strict=True)])
    assert recording.frames == 5
    chest = recording.quat[:, 1]
    np.testing.assert_allclose(2.0 * np.arctan2(chest[:, 3], chest[:, 0]), [0.0, 0.1, 0.2, 0.3, 0.4], atol=1e-3)
    assert "resampled" in recording.findings["frame durations"]


def test_iccgan_by_hand():
    frame = {"pelvis": [[1, 2, 3], [0, 0, HALF, HALF]], "torso": [0, HALF, 0, HALF]}
    recording = iccgan([frame, frame])
    assert recording.findings["links left out"].startswith("head, right_upper_arm,")
    np.testing.assert_allclose(place(recording, "pelvis"), [1, 2, 3])
    np.testing.assert_allclose(place(recording, "torso"), [1, 2, 3.236151], atol=1e-12)
    np.testing.assert_allclose(place(recording, "head"), [1, 2 + 0.223894, 3.236151], atol=1e-12)
    np.testing.assert_allclose(place(recording, "left_foot"), [1 - 0.084887, 2, 3 - 0.831416], atol=1e-12)


FRAME = {"pelvis": [[0, 0, 1], [0, 0, 0, 1]], "torso": [0, 0, 0, 1]}
SPOILED = {
    "no rows": (lambda: deepmimic([]), "fewer than 2 frames"),
    "one row": (lambda: deepmimic([row()]), "fewer than 2 frames"),
    "no Frames": (lambda: deepmimic(None), "no list Frames"),
    "short row": (lambda: deepmimic([row(), row()[:-1]]), "frame 1 is not a list of 44 numbers"),
    "text": (lambda: deepmimic([row(), ["1.0"] * 44]), "frame 1 is not a list of 44 numbers"),
    "duration 0": (lambda: deepmimic([row(0.0)] * 3), "frame 0 lasts 0 s"),
    "duration negative": (lambda: deepmimic([row(), row(-1.0), row()]), "frame 1 lasts -1 s"),
    "duration endless": (lambda: deepmimic([row(), row(1e5), row()]), r"frame 1 lasts 100000 s"),
    "duration below all bounds": (lambda: deepmimic([row(1e-320)] * 3), "frame 0 lasts 9.99989e-321 s"),
    "norm 0 where it is resampled": (
        lambda: deepmimic([row(0.03), row(0.06), row(0.03, neck=[0, 0, 0, 0]), row(0.03)]),
        "frame 2, neck: its quaternion has norm 0",
    ),
    "norm 0": (lambda: deepmimic([row(), row(neck=[0, 0, 0, 0])]), "frame 1, neck: its quaternion has norm 0"),
    "NaN": (lambda: deepmimic([row(), row(neck=[np.nan, 0, 0, 0])]), "frame 1 has a NaN"),
    "infinite": (lambda: deepmimic([row(), row(left_knee=[np.inf])]), "frame 1 has a NaN, an infinity"),
    "huge": (lambda: deepmimic([row(), row(left_knee=[10**400])]), "a number that is too large"),
    "fps 0": (lambda: iccgan([FRAME] * 2, fps=0), "fps is 0"),
    "fps negative": (lambda: iccgan([FRAME] * 2, fps=-30), "fps is -30"),
    "fps huge": (lambda: iccgan([FRAME] * 2, fps=10**400), "fps is inf"),
    "no fps": (lambda: iccgan([FRAME] * 2, fps=None), "fps is missing"),
    "no frames": (lambda: iccgan([]), "has 0 frames"),
    "one frame": (lambda: iccgan([FRAME]), "has 1 frames"),
    "frames of lists": (lambda: iccgan([[1, 2]]), "no list of maps"),
    "no pelvis": (lambda: iccgan([FRAME, {"torso": [0, 0, 0, 1]}]), "frame 1: pelvis is not"),
    "other link": (
        lambda: iccgan([FRAME, FRAME | {"tail": [0, 0, 0, 1]}]),
        "has the link 'tail'; known are pelvis, torso",
    ),
    "short rotation": (
        lambda: iccgan([FRAME, FRAME | {"torso": [0, 1]}]),
        "rotation of torso in frame 1 is not a list of 4",
    ),
    "rotation of norm 0": (lambda: iccgan([FRAME, FRAME | {"torso": [0, 0, 0, 0]}]), "frame 1, torso: its quaternion"),
    "a NaN": (lambda: iccgan([FRAME, FRAME | {"torso": [0, 0, 0, np.nan]}]), "rotation of torso in frame 1 has a NaN"),
    "nested": (lambda: read_iccgan(b"[" * 100_000, FILE, ReadOptions()), "is no JSON"),
    "many containers": (lambda: read_iccgan(b"[" + b"[]," * 3_000_000, FILE, ReadOptions()), "too large for one clip"),
    "many values": (lambda: read_deepmimic(b"[" + b"1," * 11_000_000, FILE, ReadOptions()), "too large for one clip"),
    "list": (lambda: read_iccgan(b"[1]", FILE, ReadOptions()), "holds no map"),
    "bytes": (lambda: read_iccgan(b"\xff\xfe{}", FILE, ReadOptions()), "is no JSON"),
    "digits": (lambda: read_iccgan(b'{"fps": ' + b"9" * 10_000 + b"}", FILE, ReadOptions()), "is no JSON"),
}


@pytest.mark.parametrize("spoiled", SPOILED)
def test_names_what_is_wrong_and_where(refuses, spoiled):
    read, reason = SPOILED[spoiled]
    refuses(read, reason, "clip: ")


def test_a_told_rate_mends_durations_of_0():
    assert deepmimic([row(0.0)] * 3, ReadOptions(fps=24.0)).fps == 24.0


def test_deepmimics_walk_is_on_the_ground(shared_motions):
    file = shared_motions / "deepmimic" / "humanoid3d_walk.txt"
    recording = read_deepmimic(file.read_bytes(), file, ReadOptions())
    pos, _ = recording.global_pose()
    ankles = pos[:, [DEEPMIMIC.names.index("left_ankle"), DEEPMIMIC.names.index("right_ankle")], 2]
    assert recording.loop
    assert ankles.min(axis=1).min() > 0.04  # the sole is 5 cm below
    assert ankles.min(axis=1).max() < 0.09
    assert recording.findings["left, right"] == "as named (measured)"
    assert pos[-1, 0, 0] - pos[0, 0, 0] > 1.0  # ahead is x


def test_iccgans_walk_is_on_the_ground(shared_motions):
    file = shared_motions / "walk_run_lafan1" / "locomotion" / "lafan1_walk1_subject1_100_1170.json"
    recording = read_iccgan(file.read_bytes(), file, ReadOptions())
    assert (recording.frames, recording.skeleton.names) == (1070, HUMANOID.names)
    pos, _ = recording.global_pose()
    feet = pos[:, [HUMANOID.names.index("left_foot"), HUMANOID.names.index("right_foot")], 2].min(axis=1)
    assert feet.min() > 0.03
    assert feet.max() < 0.12
