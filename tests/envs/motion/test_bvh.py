"""BVH files: kinematics by hand, what hierarchies may look like, and files as they should not be."""

from pathlib import Path

import numpy as np
import pytest

from murmillo.envs.motion.formats.bvh import read_bvh
from murmillo.envs.motion.formats.options import ReadOptions

FILE = Path("wave.bvh")
AS_IT_IS = ReadOptions(up="z", unit="m", mirror=False, drop_rest=False)

ODD_CHANNELS = """HIERARCHY
ROOT Hips
{
  OFFSET 9 9 9
  CHANNELS 5 Zposition Yrotation Xposition Yposition Zrotation
  JOINT Upper Arm
  {
    OFFSET 1 0 0
    CHANNELS 2 Xrotation Yrotation
    End Site
    {
      OFFSET 0 0 2
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0083333
3 90 1 2 90 90 90
0 0 0 0 0 0 0
"""


def read(text: str, options: ReadOptions = AS_IT_IS):
    return read_bvh(text.encode(), FILE, options)


def test_kinematics_of_odd_channels_by_hand():
    """Hips turn by Ry(90) Rz(90), the arm by Rx(90) Ry(90); the arm's (1, 0, 0) comes to (0, 1, 0), and the end's
    (0, 0, 2), which the arm turns to (2, 0, 0), to (0, 2, 0)."""
    recording = read(ODD_CHANNELS)
    assert (recording.name, recording.fps, recording.frames) == ("wave", 120.0, 2)
    assert recording.skeleton.names == ("Hips", "Upper Arm", "Upper Arm_end")
    assert recording.skeleton.parents == (-1, 0, 1)
    pos, _ = recording.global_pose()
    np.testing.assert_allclose(pos[0], [[1, 2, 3], [1, 3, 3], [1, 5, 3]], atol=1e-12)
    np.testing.assert_allclose(pos[1], [[0, 0, 0], [1, 0, 0], [1, 0, 2]], atol=1e-12)


def test_y_up_centimetres_become_z_up_metres():
    recording = read(ODD_CHANNELS, ReadOptions(up="y", unit="cm", mirror=False))
    pos, _ = recording.global_pose()
    np.testing.assert_allclose(pos[0], np.array([[1, -3, 2], [1, -3, 3], [1, -3, 5]]) / 100.0, atol=1e-12)


def test_blank_lines_tabs_and_carriage_returns_do_not_matter():
    text = ODD_CHANNELS.replace("\n", " \r\n").replace("  ", "\t").replace("3 90", "\r\n\r\n3\t90")
    np.testing.assert_array_equal(read(text).quat, read(ODD_CHANNELS).quat)
    np.testing.assert_array_equal(read("\ufeff" + text).quat, read(ODD_CHANNELS).quat)


MOVING = """HIERARCHY
ROOT World
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Hips
  {
    OFFSET 0 9 0
    CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
    JOINT Spine
    {
      OFFSET 5 5 5
      CHANNELS 3 Xposition Yposition Zposition
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.04
1 0 0 90 0 0 0 1 0 0 0 0 0 0 1
1 0 0 90 0 0 2 1 0 0 0 0 0 0 3
"""


def test_a_root_above_the_one_that_moves_is_folded_in():
    recording = read(MOVING)
    assert recording.skeleton.names == ("Hips", "Spine")
    np.testing.assert_allclose(recording.root_pos_w, [[0, 0, 0], [0, 2, 0]], atol=1e-12)
    np.testing.assert_allclose(recording.quat[:, 0], [[np.sqrt(0.5), 0, 0, np.sqrt(0.5)]] * 2)
    assert recording.findings["root"] == "Hips; World above it is folded in"


def test_positions_of_other_joints_replace_their_offset():
    recording = read(MOVING)
    np.testing.assert_allclose(recording.skeleton.offsets, [[0, 0, 0], [0, 0, 2]])
    assert recording.findings["stretching bones"] == "1, Spine by 100.0 cm; means taken"


def replaced(old: str, new: str) -> str:
    assert old in ODD_CHANNELS
    return ODD_CHANNELS.replace(old, new, 1)


SPOILED = {
    "nothing": ("", "no line MOTION"),
    "other file": ("P6 100 100 255\nMOTION\n", "line 1: does not begin with HIERARCHY"),
    "brace missing": (replaced("    }\n", ""), "ends before its last }"),
    "brace too many": (replaced("}\nMOTION", "}\n}\nMOTION"), "more after the root's last }"),
    "no brace after name": (replaced("JOINT Upper Arm\n  {", "JOINT Upper Arm\n"), "line 6: a joint has no {"),
    "nameless": (replaced("JOINT Upper Arm", "JOINT"), "no name"),
    "same name": (replaced("JOINT Upper Arm", "JOINT Hips"), "two joints named 'Hips'"),
    "stray word": (replaced("    End Site", "    Fin Site"), r"line 10: 'Fin' is not expected"),
    "offset of two": (replaced("OFFSET 1 0 0", "OFFSET 1 0"), r"line 9: 'CHANNELS' is no number"),
    "offset NaN": (replaced("OFFSET 1 0 0", "OFFSET 1 nan 0"), r"line 8: 'nan' is no number"),
    "channels short": (replaced("5 Zposition", "4 Zposition"), r"'Zrotation' is not expected"),
    "channels long": (replaced("2 Xrotation", "3 Xrotation"), r"line 10: CHANNELS 3: has 'End'"),
    "channels many": (replaced("2 Xrotation", "999999999 Xrotation"), "0 to 6"),
    "position twice": (replaced("Xposition Yposition", "Xposition Xposition"), "a position twice"),
    "no Frames": (replaced("Frames: 2\n", ""), "lacks Frames"),
    "zero frames": (replaced("Frames: 2", "Frames: 0"), "has 0 frames"),
    "frames missing": (replaced("Frames: 2", "Frames: 3"), "says Frames: 3 and has 2"),
    "frames claimed": (replaced("Frames: 2", "Frames: 999999999"), "more than murmillo reads at once"),
    "frame time 0": (replaced("0.0083333", "0"), r"Frame Time is '0'; write the seconds"),
    "frame time below all bounds": (
        replaced("0.0083333", "1e-320"),
        "Frame Time is '1e-320'; write the seconds .*--fps",
    ),
    "frame time negative": (replaced("0.0083333", "-0.01"), "Frame Time is '-0.01'"),
    "frame time text": (replaced("0.0083333", "fast"), "Frame Time is 'fast'"),
    "number missing": (replaced("0 0 0 0 0 0 0\n", "0 0 0 0 0 0\n"), "frame 1 has 6 numbers where 7 belong"),
    "number no number": (replaced("3 90 1", "3 9o 1"), "frame 0: '9o' is no number"),
    "NaN": (replaced("3 90 1", "3 nan 1"), "frame 0 has a NaN"),
    "infinite": (replaced("3 90 1", "3 1e999 1"), "frame 0 has a NaN, an infinity"),
    "one frame": (replaced("Frames: 2", "Frames: 1").removesuffix("0 0 0 0 0 0 0\n"), "has 1 frames"),
}


@pytest.mark.parametrize("spoiled", SPOILED)
def test_names_what_is_wrong_and_where(refuses, spoiled):
    text, reason = SPOILED[spoiled]
    refuses(lambda: read(text), reason, "wave.bvh: ")


def test_a_told_rate_mends_a_frame_time_of_0():
    assert read(replaced("0.0083333", "0"), ReadOptions(up="z", unit="m", fps=25.0)).fps == 25.0
