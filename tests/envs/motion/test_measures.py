"""What is measured on clips, and that each kind of broken clip is found out, at its frame."""

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs.character import Character, load_character
from murmillo.envs.motion import Clip, load_clips
from murmillo.envs.motion.editing import resample
from murmillo.envs.motion.ground import ground_of
from murmillo.envs.motion.inspection import inspect
from murmillo.envs.motion.measures import measure, tracking_error

CHARACTER = load_character("sword_shield")
CLIPS = {clip.name: clip for clip in load_clips("builtin", CHARACTER)}
GUARD, WALK = CLIPS["guard"], CLIPS["walk_forward"]


def changed(clip: Clip, change: Callable[[np.ndarray], object], **fields) -> Clip:
    """The clip with another `qpos`; `change` alters the copy that it is given."""
    qpos = clip.qpos.copy()
    change(qpos)
    return replace(clip, qpos=qpos, **fields)


def checks(clip: Clip, tracking: bool = False) -> dict[str, int]:
    """Frame of each suspicion by its check."""
    return {found.check: found.frame for found in inspect(clip, CHARACTER, tracking)}


def columns(name: str) -> slice:
    return next(joint.qpos for joint in CHARACTER.joints if joint.name == name)


def test_geoms_are_as_high_as_mujoco_says(character: Character, make_clip: Callable[..., Clip]) -> None:
    """Every shape in random poses, against MuJoCo's own distance to the floor."""
    clip = make_clip(frames=6, seed=3)
    raised = changed(clip, lambda qpos: np.add(qpos[:, 2], 3.0, out=qpos[:, 2]))
    ground = ground_of(raised, character)
    model = character.model
    data = mujoco.MjData(model)
    floor = model.geom("floor").id
    geoms = np.flatnonzero(model.geom_bodyid)
    assert ground.bodies == tuple(model.body(int(model.geom_bodyid[geom])).name for geom in geoms)
    for frame, pose in enumerate(raised.qpos):
        data.qpos = pose
        mujoco.mj_kinematics(model, data)
        heights = [mujoco.mj_geomDistance(model, data, floor, int(geom), 100.0, None) for geom in geoms]
        np.testing.assert_allclose(ground.height[frame], heights, atol=1e-6)


def test_slide_is_per_control_step_whatever_the_rate() -> None:
    """A foot that drifts by 0.6 m/s moves 2 cm in 1/30 s."""

    def drift(fps: float) -> Clip:
        return changed(
            GUARD,
            lambda qpos: np.add(qpos[:, 0], 0.6 / fps * np.arange(len(qpos)), out=qpos[:, 0]),
            fps=fps,
        )

    for fps in (30.0, 120.0):
        assert measure(drift(fps), CHARACTER, every=None).slide == pytest.approx(0.02, abs=1e-3)


def _still(frames: int = 31) -> Clip:
    """Guard's first pose, held."""
    return replace(GUARD, qpos=np.repeat(GUARD.qpos[:1], frames, axis=0))


def test_joints_are_measured_in_their_own_units() -> None:
    """An elbow that begins to turn by 0.1 rad a frame; a neck 30 degrees beyond the 50 that it has."""

    def bend(qpos: np.ndarray) -> None:
        qpos[:, columns("left_elbow")] -= 0.1 * np.clip(np.arange(31) - 10, 0, 8)[:, None]

    bent = measure(changed(_still(), bend), CHARACTER, every=None)
    assert (bent.speed, bent.jump, bent.closure) == pytest.approx((3.0, 3.0, 0.8))
    assert measure(_still(), CHARACTER, every=None).beyond_limits < 0.0
    turned = measure(changed(_still(), _turn(30, "neck", 80.0, 0)), CHARACTER, every=None)
    assert turned.beyond_limits == pytest.approx(np.radians(30.0))


def test_what_no_action_can_ask_for_is_beyond_the_limits() -> None:
    """An elbow that may bend to -2.79 rad, and targets that end at -1."""

    def narrow(spec: mujoco.MjSpec) -> None:
        spec.actuator("left_elbow").ctrlrange = [-1.0, 0.5]

    bent = changed(_still(), _set(slice(None), columns("left_elbow"), -1.5))
    assert measure(bent, load_character(edit=narrow), every=None).beyond_limits == pytest.approx(0.5)


def test_an_arm_that_passes_behind_the_vertical_does_not_leap() -> None:
    """From -170 to -190 degrees, which is +170 as a rotation vector of the least angle, in even steps of one degree."""

    def raise_arm(qpos: np.ndarray) -> None:
        for frame in range(31):
            _turn(frame, "right_shoulder", -170.0 - min(frame, 20), 1)(qpos)

    raised = measure(changed(_still(), raise_arm), CHARACTER, every=None)
    assert raised.speed == pytest.approx(np.radians(30.0))
    assert raised.jump == pytest.approx(np.radians(30.0))  # as it stops
    assert raised.closure == pytest.approx(np.radians(20.0))
    assert raised.beyond_limits == pytest.approx(np.radians(10.0))


@pytest.mark.parametrize("fps", [25.0, 60.0, 120.0])
def test_targets_follow_each_other_at_control_rate_whatever_the_clips(fps: float) -> None:
    slash = CLIPS["slash_down"]
    every = round(fps / 5.0)
    at_control_rate = tracking_error(slash, CHARACTER, every=6)
    errors = tracking_error(resample(slash, fps, CHARACTER), CHARACTER, every)
    np.testing.assert_allclose(errors[:10], at_control_rate[:10], atol=0.01)  # [rad]


def test_tracking_is_left_out_where_nobody_asks() -> None:
    assert np.isnan(measure(GUARD, CHARACTER, every=None).tracked)
    assert measure(GUARD, CHARACTER, every=60).tracked == 1.0


@pytest.mark.parametrize("name", CLIPS)
def test_built_in_clips_raise_no_suspicion(name: str) -> None:
    assert inspect(CLIPS[name], CHARACTER) == []


def _set(rows, cols, value):
    def change(qpos: np.ndarray) -> None:
        qpos[rows, cols] = value

    return change


def _add(rows, cols, value):
    def change(qpos: np.ndarray) -> None:
        qpos[rows, cols] += value

    return change


def _turn(rows, name: str, degrees: float, axis: int):
    def change(qpos: np.ndarray) -> None:
        half = np.radians(degrees) / 2
        qpos[rows, columns(name)] = [np.cos(half), *(np.sin(half) * np.eye(3)[axis])]

    return change


@pytest.mark.parametrize(
    ("check", "frame", "broken"),
    [
        ("slide", 10, changed(GUARD, _add(slice(11, None), 0, 0.03))),
        ("ground", 20, changed(GUARD, _add(20, 2, -0.04))),
        ("floating", 33, changed(GUARD, _add(slice(None), 2, np.where(np.arange(GUARD.frames) == 33, 0.1, 0.2)))),
        ("floating", 40, changed(GUARD, _add(slice(40, 80), 2, 0.1))),
        ("limits", 30, changed(GUARD, _turn(30, "neck", 80.0, 0))),
        ("speed", 29, changed(GUARD, _set(slice(30, None), columns("right_elbow"), -2.6))),
        ("jump", 30, changed(GUARD, _set(30, columns("right_elbow"), -2.6))),
        ("leap", 50, changed(WALK, _add(slice(50, None), 0, 1.0))),
        ("loop", WALK.frames - 1, replace(changed(WALK, _turn(-1, "neck", 30.0, 2)), loop=True)),
        ("loop", WALK.frames - 1, replace(changed(WALK, _add(-1, 2, 0.2)), loop=True)),
        ("rest pose", 0, changed(GUARD, _set(slice(5), slice(7, None), CHARACTER.model.qpos0[7:]))),
        ("frozen", 60, changed(GUARD, lambda qpos: np.copyto(qpos[60:75], qpos[60]))),
        ("repeats", 0, replace(GUARD, qpos=np.repeat(GUARD.qpos, 2, axis=0))),
    ],
)
def test_a_broken_clip_is_found_out(check: str, frame: int, broken: Clip) -> None:
    assert checks(broken).get(check) == frame


def test_a_t_pose_is_found_at_either_end() -> None:
    """Arms straight out to the sides: the shoulders turn by 90 degrees about x, each its own way."""

    def arms_out(rows):
        def change(qpos: np.ndarray) -> None:
            _turn(rows, "left_shoulder", 90.0, 0)(qpos)
            _turn(rows, "right_shoulder", -90.0, 0)(qpos)
            for elbow in ("left_elbow", "right_elbow"):
                qpos[rows, columns(elbow)] = 0.0

        return change

    assert checks(changed(GUARD, arms_out(slice(3))))["rest pose"] == 0
    assert checks(changed(GUARD, arms_out(slice(-3, None))))["rest pose"] == GUARD.frames - 1
    assert "rest pose" not in checks(changed(GUARD, arms_out(slice(30, 40))))


def test_a_foot_that_never_touches_the_ground() -> None:
    """One leg lifted all the time; the whole body is not in the air."""
    lifted = changed(GUARD, lambda qpos: qpos.__setitem__((slice(None), columns("left_knee")), 1.5))
    found = {suspicion.check: suspicion.what for suspicion in inspect(lifted, CHARACTER)}
    assert "left_foot" in found["foot"]
    assert "floating" not in found


def test_an_arm_behind_the_vertical_is_within_its_limits() -> None:
    """-190 degrees is +170 as a rotation vector of the least angle, which alone would be 125 beyond the box."""
    raised = changed(GUARD, _turn(slice(None), "right_shoulder", -190.0, 1))
    limits = next((found.what for found in inspect(raised, CHARACTER) if found.check == "limits"), "")
    assert limits == "the right_shoulder is 10 degrees beyond its limit"


def test_what_pd_targets_cannot_follow_is_told() -> None:
    def fling(qpos: np.ndarray) -> None:
        for name, angle in (("left_knee", 2.5), ("right_knee", 2.5), ("left_elbow", -2.5), ("right_elbow", -2.5)):
            qpos[::2, columns(name)] = angle

    flung = changed(GUARD, fling)
    assert "tracking" in checks(flung, tracking=True)
    assert "tracking" not in checks(flung)
    assert "tracking" not in checks(GUARD, tracking=True)


def test_a_clip_of_two_frames_can_be_inspected() -> None:
    assert measure(replace(GUARD, qpos=GUARD.qpos[:2]), CHARACTER, every=None).jump == 0.0
    assert checks(replace(GUARD, qpos=GUARD.qpos[:2])) == {}
    brief = replace(GUARD, qpos=GUARD.qpos[:2], fps=120.0)  # shorter than a control step
    assert checks(brief, tracking=True) == {}


def test_inspection_changes_nothing() -> None:
    before = GUARD.qpos.copy()
    inspect(GUARD, CHARACTER, tracking=True)
    assert torch.equal(torch.tensor(GUARD.qpos), torch.tensor(before))
