"""A clip refuses what no clip can be, and is made fit for its character without changing its poses."""

from dataclasses import replace

import numpy as np
import pytest

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import check_clip


def test_duration_is_from_first_to_last_frame(make_clip):
    assert make_clip(frames=61, fps=30.0).duration == 2.0


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"fps": 0.0}, "fps is 0"),
        ({"fps": -30.0}, "fps is -30"),
        ({"fps": float("nan")}, "fps is nan"),
        ({"weight": 0.0}, "weight is 0"),
        ({"weight": float("inf")}, "weight is inf"),
        ({"qpos": np.zeros((1, 47))}, "at least 2"),
        ({"qpos": np.zeros(47)}, "at least 2"),
        ({"label": ""}, "printable"),
        ({"label": "two\nlines"}, "printable"),
    ],
)
def test_refuses(make_clip, fields, reason):
    with pytest.raises(MotionError, match=reason):
        make_clip(**fields)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e9])
def test_names_the_frame_of_a_broken_number(make_clip, value):
    qpos = make_clip().qpos.copy()
    qpos[7, 21] = value
    with pytest.raises(MotionError, match="clip drift: frame 7 of 20"):
        make_clip(qpos=qpos)


def test_frames_cannot_be_changed(make_clip):
    with pytest.raises(ValueError, match="read-only"):
        make_clip().qpos[0, 0] = 1.0


def test_names_frame_and_joint_of_a_quaternion_that_is_no_rotation(make_clip, character):
    qpos = make_clip().qpos.copy()
    neck = next(joint for joint in character.joints if joint.name == "neck")
    qpos[4, neck.qpos] *= 0.9
    with pytest.raises(MotionError, match=r"frame 4, neck: its quaternion has norm 0\.9"):
        check_clip(make_clip(qpos=qpos), character)


def test_refuses_to_mask_what_the_character_has_not(make_clip, character):
    with pytest.raises(MotionError, match="masks 'halberd', sword_shield has right_hand, left_hand"):
        check_clip(replace(make_clip(), masked=("sword", "halberd")), character)


def test_refuses_another_character_and_another_width(make_clip, character):
    with pytest.raises(MotionError, match="for the character dragon, not sword_shield"):
        check_clip(replace(make_clip(), character="dragon"), character)
    with pytest.raises(MotionError, match="frames have 46 numbers, sword_shield has 47"):
        check_clip(make_clip(qpos=np.zeros((3, 46))), character)


def test_quaternions_become_unit_and_continuous_in_sign(make_clip, character):
    smooth = check_clip(make_clip(), character)
    qpos = smooth.qpos.copy()
    qpos[3:8, 3:7] *= -1.0
    qpos[11, 7:11] *= -1.0
    qpos[:, 3:7] *= 1.0 + 1e-6
    checked = check_clip(make_clip(qpos=qpos), character)
    np.testing.assert_allclose(checked.qpos, smooth.qpos, atol=1e-15)


def test_checking_twice_changes_no_bit(make_clip, character):
    once = check_clip(make_clip(), character)
    assert np.array_equal(check_clip(once, character).qpos, once.qpos)
