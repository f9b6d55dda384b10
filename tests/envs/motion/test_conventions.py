"""What is found out about files: axes, units, rest poses, left and right; and what a user may tell instead."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.conventions import settle
from murmillo.envs.motion.formats.humanoid import HUMANOID
from murmillo.envs.motion.formats.options import UNITS, ReadOptions
from murmillo.envs.motion.formats.quaternions import IDENTITY, about_axis, conjugate, multiply, rotate
from murmillo.envs.motion.formats.raw_motion import RawMotion
from murmillo.envs.motion.formats.recording import Skeleton
from murmillo.envs.motion.formats.roles import find_roles

FILE = Path("some clip.bvh")


@pytest.fixture
def walk() -> RawMotion:
    """Two seconds on bent legs that swing, x ahead, z up, metres; nothing is said about its axes."""
    time = np.arange(60) / 30.0
    quat = np.tile(IDENTITY, (60, 15, 1))
    swing = 0.4 * np.sin(2.0 * np.pi * time)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        quat[:, HUMANOID.names.index(f"{side}_thigh")] = about_axis(1, -0.3 + sign * swing)
        quat[:, HUMANOID.names.index(f"{side}_shin")] = about_axis(1, np.full(60, 0.6))
    return RawMotion(HUMANOID, np.stack([time, 0.0 * time, 0.0 * time + 0.85], axis=1), quat, 30.0)


def y_up(raw: RawMotion) -> RawMotion:
    turn = about_axis(0, -np.pi / 2.0)
    return replace(
        raw,
        skeleton=replace(raw.skeleton, offsets=rotate(turn, raw.skeleton.offsets)),
        root_pos=rotate(turn, raw.root_pos),
        quat=multiply(multiply(turn, raw.quat), conjugate(turn)),
    )


def scaled(raw: RawMotion, factor: float) -> RawMotion:
    skeleton = replace(raw.skeleton, offsets=factor * raw.skeleton.offsets)
    return replace(raw, skeleton=skeleton, root_pos=factor * raw.root_pos)


def mirrored(raw: RawMotion) -> RawMotion:
    reflect = np.array([1.0, -1.0, 1.0])
    return replace(
        raw,
        skeleton=replace(raw.skeleton, offsets=reflect * raw.skeleton.offsets),
        root_pos=reflect * raw.root_pos,
        quat=raw.quat * np.array([1.0, -1.0, 1.0, -1.0]),
    )


def with_rest(raw: RawMotion, frames: int) -> RawMotion:
    rest = np.tile(IDENTITY, (frames, 15, 1))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        rest[:, HUMANOID.names.index(f"{side}_upper_arm")] = about_axis(0, sign * np.pi / 2.0)
        rest[:, HUMANOID.names.index(f"{side}_thigh")] = about_axis(1, 0.9)
    pos = np.concatenate([np.tile([0.0, 0.0, 0.9], (frames, 1)), raw.root_pos])
    return replace(raw, quat=np.concatenate([rest, raw.quat]), root_pos=pos)


def same(recording, raw: RawMotion) -> bool:
    wanted = settle(raw, FILE, ReadOptions(up="z", unit="m", mirror=False, drop_rest=False)).global_pose()[0]
    return np.allclose(recording.global_pose()[0], wanted, atol=1e-9)


def test_all_is_found_out_at_once(walk):
    raw = scaled(y_up(mirrored(with_rest(walk, 1))), 100.0)
    recording = settle(raw, FILE, ReadOptions())
    assert same(recording, walk)
    assert recording.name == "some clip"
    assert recording.findings == {
        "fps": "30 (format)",
        "up": "y (measured)",
        "unit": "cm (measured)",
        "height": "1.38 m",
        "rest frame": "1 left out",
        "left, right": "were exchanged, mirrored",
    }


def test_who_lies_does_not_mislead_about_up(walk):
    quat = walk.quat.copy()
    quat[:, 0] = about_axis(1, -np.pi / 2.0)
    assert settle(y_up(replace(walk, quat=quat)), FILE, ReadOptions()).findings["up"] == "y (measured)"


def test_a_rest_pose_that_no_human_has_does_not_mislead_about_up(walk):
    turn = about_axis(1, 0.5 * np.pi)  # all joints' frames: the figure rests along x, and moves as before
    quat = multiply(multiply(conjugate(turn), walk.quat), turn)
    quat[:, 0] = multiply(turn, quat[:, 0])
    skeleton = replace(HUMANOID, offsets=rotate(conjugate(turn), HUMANOID.offsets))
    recording = settle(replace(walk, skeleton=skeleton, quat=quat), FILE, ReadOptions())
    assert recording.findings["up"] == "z (measured)"
    assert same(recording, walk)


@pytest.mark.parametrize("unit", UNITS)
def test_units_are_told_apart_by_the_figures_size(walk, unit):
    recording = settle(scaled(walk, 1.0 / UNITS[unit]), FILE, ReadOptions())
    assert recording.findings["unit"] == f"{unit} (measured)"
    assert same(recording, walk)


def test_a_unit_that_the_format_says_is_taken_if_it_makes_a_person(walk):
    assert settle(replace(scaled(walk, 0.8), unit=1.0), FILE, ReadOptions()).findings["unit"] == "m (format)"
    recording = settle(replace(walk, unit=0.01), FILE, ReadOptions())
    assert recording.findings["unit"] == "m (measured)"
    assert same(recording, walk)


def test_a_sound_clip_is_left_alone(walk):
    recording = settle(walk, FILE, ReadOptions())
    assert same(recording, walk)
    assert recording.findings["left, right"] == "as named (measured)"
    assert recording.findings["rest frame"] == "none"


def test_what_is_told_wins(walk):
    raw = scaled(with_rest(mirrored(walk), 1), 100.0)
    told = ReadOptions(up="z", unit="0.02", fps=50.0, drop_rest=False, mirror=False)
    recording = settle(raw, FILE, told)
    assert recording.fps == 50.0
    assert same(recording, scaled(with_rest(mirrored(walk), 1), 2.0))
    assert [recording.findings[name] for name in ("up", "unit", "fps", "rest frame", "left, right")] == [
        "z (told)",
        "0.02 m (told)",
        "50 (told)",
        "kept (told)",
        "as named (told)",
    ]


def test_a_rest_pose_that_is_held_is_left_out_whole(walk):
    assert settle(with_rest(walk, 7), FILE, ReadOptions()).frames == walk.quat.shape[0]


def test_the_first_frame_is_left_out_when_told(walk):
    assert settle(walk, FILE, ReadOptions(drop_rest=True)).frames == 59


def test_a_jump_later_on_is_no_rest_pose(walk):
    quat = walk.quat.copy()
    quat[30:, 3] = about_axis(0, 2.5)
    assert settle(replace(walk, quat=quat), FILE, ReadOptions()).frames == 60


def test_a_first_step_as_fast_as_the_others_is_no_rest_pose(walk):
    slow = replace(walk, quat=walk.quat[::5], root_pos=walk.root_pos[::5], fps=6.0)
    assert settle(slow, FILE, ReadOptions()).frames == 12


def test_a_size_that_no_person_has_asks_for_the_unit(walk):
    with pytest.raises(
        MotionError, match=r"some clip\.bvh: its figure is 1\.38e\+05 units tall.*give unit= \(--unit\)"
    ):
        settle(scaled(walk, 1e5), FILE, ReadOptions())
    assert settle(scaled(walk, 9.0), FILE, ReadOptions(unit="m")).findings["height"] == "12.39 m"


def test_names_that_say_nothing_leave_the_axes_as_the_format_usually_has_them(walk):
    names = tuple(f"bone {i}" for i in range(15))
    recording = settle(replace(walk, skeleton=replace(HUMANOID, names=names)), FILE, ReadOptions(up="z"))
    assert recording.findings["unit"] == "m (measured)"
    assert recording.findings["left, right"] == "as named (assumed)"
    assert (
        settle(y_up(replace(walk, skeleton=replace(HUMANOID, names=names))), FILE, ReadOptions()).findings["up"]
        == "y (assumed)"
    )


def test_a_rate_that_no_recorder_has_is_pointed_out(walk):
    assert "unusual" in settle(replace(walk, fps=3.0), FILE, ReadOptions()).findings["fps"]


@pytest.mark.parametrize("fps", [0.0, -30.0, np.nan, np.inf, 1e-200])
def test_no_motion_has_such_a_rate(walk, fps):
    with pytest.raises(MotionError, match=r"fps is .* fps= \(--fps\)"):
        settle(replace(walk, fps=fps), FILE, ReadOptions())
    assert settle(replace(walk, fps=fps), FILE, ReadOptions(fps=30.0)).fps == 30.0


def test_quaternions_are_made_units_or_refused(walk):
    quat = walk.quat.copy()
    quat[5, 3] *= 0.8
    recording = settle(replace(walk, quat=quat), FILE, ReadOptions())
    assert same(recording, walk)
    np.testing.assert_allclose(np.linalg.norm(recording.quat, axis=-1), 1.0)
    assert recording.findings["quaternions"] == "norms 0.80 to 1.00; made units"
    quat[5, 3] = 0.0
    with pytest.raises(MotionError, match="frame 5, right_upper_arm: its quaternion has norm 0"):
        settle(replace(walk, quat=quat), FILE, ReadOptions())


@pytest.mark.parametrize(
    "options",
    [{"up": "x"}, {"unit": "furlong"}, {"unit": "-1"}, {"unit": "nan"}, {"fps": 0.0}, {"fps": np.nan}, {"fps": 1e-200}],
)
def test_options_that_nothing_can_have(options):
    with pytest.raises(MotionError, match=f"^{next(iter(options))}="):
        ReadOptions(**options)


@pytest.mark.parametrize(
    "names",
    [
        "Hips Head LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase",
        "mixamorig:Hips mixamorig:Head mixamorig:LeftUpLeg mixamorig:LeftLeg mixamorig:LeftFoot mixamorig:LeftToeBase "
        "mixamorig:RightUpLeg mixamorig:RightLeg mixamorig:RightFoot mixamorig:RightToeBase",
        "root head lfemur ltibia lfoot ltoes rfemur rtibia rfoot rtoes",
        "Hips Head UpperLeg_L LowerLeg_L Foot_L Toes_L UpperLeg_R LowerLeg_R Foot_R Toes_R",
        "pelvis neck left_hip left_knee left_ankle left_foot right_hip right_knee right_ankle right_foot",
        "hips head thigh.L shin.L foot.L toe.L thigh.R shin.R foot.R toe.R",
        "Bip01_Pelvis Bip01_Head Bip01_L_Thigh Bip01_L_Calf Bip01_L_Foot Bip01_L_Toe0 "
        "Bip01_R_Thigh Bip01_R_Calf Bip01_R_Foot Bip01_R_Toe0",
    ],
)
def test_legs_are_known_by_the_names_of_many_skeletons(names):
    skeleton = Skeleton(tuple(names.split()), (-1, 0, 0, 2, 3, 4, 0, 6, 7, 8), np.zeros((10, 3)))
    roles = find_roles(skeleton)
    assert roles is not None
    assert (roles.head, *vars(roles.left).values(), *vars(roles.right).values()) == (1, 2, 3, 4, 5, 6, 7, 8, 9)
