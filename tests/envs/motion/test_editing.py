"""Cutting, resampling and mirroring clips."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from murmillo.envs.character import load_character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion import load_clips
from murmillo.envs.motion.clip import check_clip
from murmillo.envs.motion.editing import mirror, other_side, resample, trim

CHARACTER = load_character("sword_shield")
CLIPS = {clip.name: clip for clip in load_clips("builtin", CHARACTER)}
GUARD, WALK = CLIPS["guard"], CLIPS["walk_forward"]


def test_trim_keeps_the_frames_between_the_times() -> None:
    cut = trim(WALK, 1.0, 2.5)
    np.testing.assert_array_equal(cut.qpos, WALK.qpos[30:76])
    assert (cut.duration, cut.label, cut.licence) == (1.5, WALK.label, WALK.licence)
    np.testing.assert_array_equal(trim(WALK, 1.01).qpos, WALK.qpos[30:])  # to the nearest frame


def test_only_a_whole_loop_stays_one() -> None:
    assert GUARD.loop
    assert trim(GUARD).loop
    assert not trim(GUARD, 0.5).loop


@pytest.mark.parametrize(
    ("start", "end"),
    [
        (-0.1, None),
        (1.0, 1.0),
        (2.0, 1.0),
        (0.0, 100.0),
        (0.0, WALK.duration + 0.02),
        (1.0, 1.01),
        (float("nan"), 1.0),
        (99.0, None),
    ],
)
def test_trim_refuses_times_that_leave_no_clip(start: float, end: float | None) -> None:
    with pytest.raises(MotionError, match="clip walk_forward: "):
        trim(WALK, start, end)


def test_resampled_at_its_own_rate_a_clip_is_the_same() -> None:
    np.testing.assert_allclose(resample(WALK, 30.0, CHARACTER).qpos, check_clip(WALK, CHARACTER).qpos, atol=1e-12)


def test_resampling_interpolates_and_keeps_the_time() -> None:
    twice = resample(WALK, 60.0, CHARACTER)
    assert (twice.frames, twice.duration) == (2 * WALK.frames - 1, WALK.duration)
    np.testing.assert_allclose(twice.qpos[::2], check_clip(WALK, CHARACTER).qpos, atol=1e-12)
    np.testing.assert_allclose(twice.qpos[1, :3], 0.5 * (WALK.qpos[0, :3] + WALK.qpos[1, :3]), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(twice.qpos[:, 3:7], axis=1), 1.0, atol=1e-12)
    slow = resample(WALK, 12.0, CHARACTER)
    assert WALK.duration - 1 / 12.0 < slow.duration <= WALK.duration


def test_a_resampled_loop_still_closes() -> None:
    loop = resample(GUARD, 17.0, CHARACTER)
    np.testing.assert_allclose(np.abs(loop.qpos[[0, -1]]), np.abs(GUARD.qpos[[0, -1]]), atol=1e-12)
    assert abs(loop.duration - GUARD.duration) <= 0.5 / 17.0


@pytest.mark.parametrize("fps", [0.0, -30.0, float("inf"), float("nan"), 0.01])
def test_resample_refuses_rates_that_leave_no_clip(fps: float) -> None:
    with pytest.raises(MotionError, match="clip walk_forward: "):
        resample(WALK, fps, CHARACTER)


def test_mirrored_points_of_the_body_are_reflections() -> None:
    """Feet, hands and trunk are where a mirror shows those of the other side."""
    for name in ("walk_forward", "kick", "turn_left_90"):
        clip = CLIPS[name]
        mirrored = mirror(clip, CHARACTER)
        before, _ = CHARACTER.forward_kinematics(torch.tensor(clip.qpos))
        after, _ = CHARACTER.forward_kinematics(torch.tensor(mirrored.qpos))
        for body in CHARACTER.bodies:
            if body not in ("sword", "shield"):
                seen = before[:, CHARACTER.bodies.index(other_side(body))] * torch.tensor([1.0, -1.0, 1.0])
                torch.testing.assert_close(after[:, CHARACTER.bodies.index(body)], seen, atol=1e-9, rtol=0.0)


def test_what_has_no_other_side_is_masked() -> None:
    mirrored = mirror(WALK, CHARACTER)
    assert mirrored.masked == ("sword", "shield")
    wrist = next(joint for joint in CHARACTER.joints if joint.name == "right_wrist")
    np.testing.assert_array_equal(mirrored.qpos[:, wrist.qpos], np.tile([1.0, 0.0, 0.0, 0.0], (WALK.frames, 1)))


def test_mirroring_twice_gives_the_clip_back_but_for_the_wrist() -> None:
    twice = mirror(mirror(WALK, CHARACTER), CHARACTER)
    wrist = next(joint for joint in CHARACTER.joints if joint.name == "right_wrist")
    kept = np.ones(WALK.qpos.shape[1], dtype=bool)
    kept[wrist.qpos] = False
    np.testing.assert_allclose(np.abs(twice.qpos[:, kept]), np.abs(WALK.qpos[:, kept]), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "mirrored"),
    [
        ("turn_left_90", "turn_right_90"),
        ("WalkRight01", "WalkLeft01"),
        ("kick", "kick_mirrored"),
        ("upright", "upright_mirrored"),
    ],
)
def test_names_change_sides(name: str, mirrored: str) -> None:
    clip = mirror(replace(WALK, name=name, label="dodge left"), CHARACTER)
    assert (clip.name, clip.label) == (mirrored, "dodge right")
