"""Acclaim skeletons and motions: kinematics by hand, CMU's subject 02, and files as they should not be."""

from pathlib import Path

import numpy as np
import pytest

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.amc import read_amc
from murmillo.envs.motion.formats.options import ReadOptions

ASF = """# two bones
:version 1.10
:name VICON
:units
  mass 1.0
  length 0.5
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 1 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name lfemur
    direction 0 -1 0
    length 2
    axis 0 0 90 XYZ
    dof rx rz
    limits (-160.0 20.0)
           (-70.0 70.0)
  end
  begin
    id 2
    name ltibia
    direction 1 0 0
    length 3
    axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root lfemur
    lfemur ltibia
  end
"""
AMC = """#!OML:ASF nowhere
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 90 0
lfemur 90 0
2
root 0 0 0 90 90 0
lfemur 0 0
"""
AS_IT_IS = ReadOptions(up="z", unit="m", mirror=False, drop_rest=False)


@pytest.fixture
def read(tmp_path):
    """Read these texts as files beside each other."""

    def read(amc: str = AMC, asf: str | None = ASF, options: ReadOptions = AS_IT_IS, name: str = "02_01.amc"):
        if asf is not None:
            (tmp_path / "02.asf").write_text(asf)
        return read_amc(amc.encode(), tmp_path / name, options)

    return read


def test_kinematics_by_hand(read):
    """Frame 1: the thigh's own x axis is the world's y, and the root turns about y as well: the shin's (3, 0, 0) comes
    to (0, 0, -3), then to (-3, 0, 0), and the thigh stays below the root.

    Frame 2: the root turns by 90 degrees about x, then y: (0, -2, 0) comes to (0, 0, -2), then to (-2, 0, 0)."""
    recording = read()
    assert recording.skeleton.names == ("root", "lfemur", "ltibia", "ltibia_end")
    pos, _ = recording.global_pose()
    np.testing.assert_allclose(pos[0], [[1, 3, 3], [1, 3, 3], [1, 1, 3], [-2, 1, 3]], atol=1e-12)
    np.testing.assert_allclose(pos[1], [[0, 1, 0], [0, 1, 0], [-2, 1, 0], [-2, 1, -3]], atol=1e-12)


def test_a_bone_turns_about_its_own_axes(read):
    """The thigh's axes are the world's turned by 90 degrees about z: their z is the world's, their x is the world's y.

    90 about their x, then 90 about their z: the thigh stays below, then comes to (2, 0, 0); the shin comes to
    (0, 0, -3), and stays there."""
    recording = read(AMC.replace("lfemur 90 0", "lfemur 90 90").replace("1 2 3 0 90 0", "0 0 0 0 0 0"))
    np.testing.assert_allclose(recording.global_pose()[0][0, 2:], [[2, 1, 0], [2, 1, -3]], atol=1e-12)


def test_the_root_turns_in_the_order_of_its_axis_from_its_orientation(read):
    """At rest it is turned by 90 degrees about z; then it turns by 90 about z, and last by 90 about x: the thigh's
    (0, -2, 0) comes to (2, 0, 0), (0, 2, 0), (0, 0, 2), the shin's (3, 0, 0) to (0, 3, 0), (-3, 0, 0) and stays."""
    asf = ASF.replace("axis XYZ\n  position", "axis ZXY\n  position").replace("orientation 0 0 0", "orientation 0 0 90")
    recording = read(AMC.replace("1 2 3 0 90 0", "0 0 0 90 0 90").replace("lfemur 90 0", "lfemur 0 0"), asf)
    np.testing.assert_allclose(recording.global_pose()[0][0, 2:], [[0, 1, 2], [-3, 1, 2]], atol=1e-12)


def test_radians_and_the_part_of_an_inch(read):
    degrees = read()
    radians = read(AMC.replace(":DEGREES", ":RADIANS").replace("90", repr(np.pi / 2)))
    np.testing.assert_allclose(radians.quat, degrees.quat, atol=1e-12)
    turned = read(asf=ASF.replace("angle deg", "angle rad").replace("0 0 90 XYZ", f"0 0 {np.pi / 2!r} XYZ"))
    np.testing.assert_allclose(turned.quat, degrees.quat, atol=1e-12)


def test_which_skeleton_is_meant(read, tmp_path):
    assert read(name="walk.amc").findings["skeleton"] == "02.asf"  # the only one
    (tmp_path / "0.asf").write_text("no skeleton")
    (tmp_path / "0_2.asf").write_text(ASF)
    assert read(name="02_01.amc").findings["skeleton"] == "02.asf"  # the subject's
    assert read(name="0_2_01.amc", asf=None).findings["skeleton"] == "0_2.asf"  # the nearest of several names
    with pytest.raises(MotionError, match=r"walk\.amc: which of 0\.asf, 02\.asf, 0_2\.asf is its skeleton"):
        read(name="walk.amc")


def test_a_bone_that_cannot_turn_may_be_listed(read):
    listed = AMC.replace("lfemur 90 0", "lfemur 90 0\nltibia").replace("lfemur 0 0", "lfemur 0 0\nltibia")
    np.testing.assert_array_equal(read(listed).quat, read().quat)


def test_no_skeleton_beside_it(read):
    with pytest.raises(MotionError, match=r"02_01\.amc: has no skeleton beside it; put the subject's \.asf"):
        read(asf=None)


BAD_AMC = {
    "nothing": ("", "no numbered frames"),
    "no frames": (":FULLY-SPECIFIED\n:DEGREES\n", "no numbered frames"),
    "one frame": (AMC.split("2\nroot")[0], "has 1 frames"),
    "cut within a frame": (AMC.removesuffix("lfemur 0 0\n"), "ends within a frame"),
    "other bone": (AMC.replace("lfemur", "wing"), r"'wing' is not a bone of 02\.asf"),
    "bone twice": (AMC.replace("lfemur 90 0", "root 0 0 0 0 0 0"), "comes twice"),
    "bone missing": (AMC.replace("lfemur 90 0\n", "").replace("lfemur 0 0\n", ""), "says nothing of lfemur"),
    "other order": (AMC.replace("lfemur 0 0", "root 0 0"), "frame 1 lacks lfemur"),
    "number missing": (AMC.replace("lfemur 0 0", "lfemur 0"), "lfemur in frame 1 has 1 numbers where 2 belong"),
    "no number": (AMC.replace("lfemur 0 0", "lfemur 0 O"), "'O' is no number"),
    "NaN": (AMC.replace("lfemur 0 0", "lfemur 0 nan"), "lfemur in frame 1 has a NaN"),
    "long line": (AMC.replace("lfemur 0 0", "lfemur" + " 0" * 500), "has 999 bytes where 2 numbers belong"),
    "no root": (AMC.replace("root 1 2 3 0 90 0\n", "").replace("root 0 0 0 90 90 0\n", ""), "says nothing of root"),
    "no numbers": (AMC.replace("lfemur 0 0", "lfemur"), "lfemur in frame 1 has 0 numbers"),
}


@pytest.mark.parametrize("bad", BAD_AMC)
def test_motions_that_are_wrong(read, refuses, tmp_path, bad):
    text, reason = BAD_AMC[bad]
    refuses(lambda: read(text), reason, f"{tmp_path / '02_01.amc'}: ")


BAD_ASF = {
    "nothing": ("", "no :bonedata"),
    "unit 0": (ASF.replace("length 0.5", "length 0"), "a length of 0 is no unit"),
    "no direction": (ASF.replace("direction 0 -1 0", "direction 0 -1"), "lfemur: '0 -1' are not 3 numbers"),
    "NaN": (ASF.replace("length 2", "length nan"), "lfemur: 'nan' are not 1 numbers"),
    "order": (ASF.replace("0 0 90 XYZ", "0 0 90 XXZ"), "'xxz' is no order"),
    "dof": (ASF.replace("dof rx rz", "dof rx rx"), "'rx rx' are no dof"),
    "unknown child": (ASF.replace("lfemur ltibia", "lfemur wing"), "line 34: the hierarchy names 'wing'"),
    "loop": (ASF.replace("root lfemur\n", "ltibia lfemur\n"), "does not hang from the root"),
    "two parents": (ASF.replace("root lfemur\n", "root lfemur ltibia\n"), "a second parent"),
    "same name": (ASF.replace("name ltibia", "name lfemur"), "'lfemur' is one too many"),
    "outside": (ASF.replace(":bonedata\n  begin", ":bonedata"), "'id' is outside of begin and end"),
}


@pytest.mark.parametrize("bad", BAD_ASF)
def test_skeletons_that_are_wrong(read, refuses, tmp_path, bad):
    text, reason = BAD_ASF[bad]
    refuses(lambda: read(asf=text), reason, f"{tmp_path / '02.asf'}: ")


@pytest.fixture(scope="module")
def cmu(shared_motions) -> Path:
    return shared_motions / "cmu_asf_amc"


def test_subject_02_walks_upright_on_the_ground(cmu):
    file = cmu / "02_01.amc"
    recording = read_amc(file.read_bytes(), file, ReadOptions())
    assert (recording.frames, recording.fps) == (343, 120.0)
    assert recording.findings["unit"] == "in/0.45 (format)"
    assert recording.findings["left, right"] == "as named (measured)"
    pos, _ = recording.global_pose()
    names = recording.skeleton.names
    height = {name: pos[:, names.index(name), 2] for name in ("head_end", "root", "lfoot", "rfoot", "ltoes", "rtoes")}
    assert 1.5 < height["head_end"].mean() < 1.7
    assert 0.85 < height["root"].mean() < 1.05
    assert np.all(height["head_end"] > height["root"] + 0.5)
    lowest = np.minimum(height["ltoes"], height["rtoes"])
    assert lowest.min() > -0.02
    assert lowest.max() < 0.08
    for side in "lr":  # each toe stands still for a good part of the walk, and moves fast in between
        toe = pos[:, names.index(f"{side}toes"), :2]
        speed = np.linalg.norm(np.diff(toe, axis=0), axis=1) * recording.fps
        assert np.percentile(speed, 25) < 0.15
        assert speed.max() > 2.0
