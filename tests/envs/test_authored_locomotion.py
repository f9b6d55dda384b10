"""The built-in ways of moving: each goes where its name says, runs and leaps fly freely, and feet never cross."""

import mujoco
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from murmillo.envs.character import load_character
from murmillo.envs.motion import Clip, load_clips
from murmillo.envs.motion.ground import GROUNDED, ground_of
from murmillo.envs.rotations import heading

CHARACTER = load_character("sword_shield")
CLIPS = {clip.name: clip for clip in load_clips("builtin", CHARACTER)}
GRAVITY = 9.81  # [m/s^2]

# Of each gait the way that it goes, ahead and to the left, and the range of its highest speed over a second [m/s].
GAITS = {
    "walk_forward": ((1.0, 0.0), (1.1, 1.5)),
    "walk_backward": ((-1.0, 0.0), (0.7, 1.1)),
    "walk_left": ((0.0, 1.0), (0.3, 0.6)),
    "walk_right": ((0.0, -1.0), (0.3, 0.6)),
    "run_forward": ((1.0, 0.0), (2.8, 4.0)),
    "run_backward": ((-1.0, 0.0), (1.9, 2.5)),
    "run_left": ((0.0, 1.0), (1.8, 2.5)),
    "run_right": ((0.0, -1.0), (1.8, 2.5)),
    "crouch_walk": ((1.0, 0.0), (0.6, 0.9)),
    "shield_charge": ((1.0, 0.0), (1.0, 2.5)),
    "dodge_left": ((0.0, 1.0), (0.4, 1.0)),
    "dodge_right": ((0.0, -1.0), (0.4, 1.0)),
    "dodge_back": ((-1.0, 0.0), (0.3, 1.0)),
}
# How often both feet are in the air, at least, and for how many frames.
FLIGHTS = {
    "run_forward": (5, 3),
    "run_backward": (6, 2),
    "run_left": (6, 2),
    "run_right": (6, 2),
    "jump": (1, 11),
    "dodge_left": (1, 3),
    "dodge_right": (1, 3),
    "dodge_back": (1, 3),
}


def centre_of_mass(clip: Clip) -> NDArray[np.float64]:
    """Of each frame [F, 3] [m]."""
    data = mujoco.MjData(CHARACTER.model)
    path = []
    for data.qpos in clip.qpos:
        mujoco.mj_kinematics(CHARACTER.model, data)
        mujoco.mj_comPos(CHARACTER.model, data)
        path.append(data.subtree_com[1].copy())
    return np.array(path)


def flights(clip: Clip) -> list[slice]:
    """The frames in which no sole touches the ground, a slice a flight."""
    airborne = (ground_of(clip, CHARACTER).sole_height > GROUNDED).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], airborne, [False]]).astype(int)))
    return [slice(start, end) for start, end in edges.reshape(-1, 2)]


@pytest.mark.parametrize("name", GAITS)
def test_goes_where_its_name_says(name: str) -> None:
    (ahead, left), (slowest, fastest) = GAITS[name]
    path = CLIPS[name].qpos[:, :2]
    way = path[-1] - path[0]
    np.testing.assert_allclose(way / np.linalg.norm(way), (ahead, left), atol=0.05)
    speed = ((path[30:] - path[:-30]) @ (ahead, left)).max()
    assert slowest < speed < fastest
    yaw = heading(torch.from_numpy(CLIPS[name].qpos[:, 3:7].copy())).numpy()
    assert np.abs(yaw - yaw[0]).max() < np.radians(30.0)  # it does not turn into its way


@pytest.mark.parametrize("name", FLIGHTS)
def test_flies_freely(name: str) -> None:
    """In the air the centre of mass has the acceleration of gravity: no more than a frame at either end is blurred."""
    times, frames = FLIGHTS[name]
    flown = [flight for flight in flights(CLIPS[name]) if flight.stop - flight.start >= frames]
    assert len(flown) >= times
    acceleration = np.diff(centre_of_mass(CLIPS[name]), n=2, axis=0) * CLIPS[name].fps ** 2
    middle = np.array([acceleration[(flight.start + flight.stop - 1) // 2 - 1] for flight in flown])
    np.testing.assert_allclose(middle[:, 2], -GRAVITY, atol=2.0)
    assert np.abs(middle[:, :2]).max() < 5.0


@pytest.mark.parametrize("name", ["walk_forward", "run_forward"])
def test_a_foot_never_flies_back(name: str) -> None:
    """Not even where the body is slow, at the beginning and at the end."""
    position, _ = CHARACTER.forward_kinematics(torch.from_numpy(CLIPS[name].qpos.copy()))
    feet = position[:, CHARACTER.body_ids(CHARACTER.feet), 0].numpy()
    assert (np.diff(feet, axis=0) * CLIPS[name].fps).min() > -0.4  # [m/s]


@pytest.mark.parametrize("name", ["walk_left", "walk_right", "run_left", "run_right"])
def test_feet_never_cross_sideways(name: str) -> None:
    position, _ = CHARACTER.forward_kinematics(torch.from_numpy(CLIPS[name].qpos.copy()))
    left, right = (position[:, CHARACTER.bodies.index(f"{side}_foot"), 1] for side in ("left", "right"))
    assert (left - right).min() > 0.15  # [m]


@pytest.mark.parametrize(
    ("name", "angle"),
    [("turn_left_90", 90.0), ("turn_right_90", -90.0), ("turn_left_180", 180.0), ("turn_right_180", -180.0)],
)
def test_turns_by_its_angle(name: str, angle: float) -> None:
    yaw = np.unwrap(heading(torch.from_numpy(CLIPS[name].qpos[:, 3:7].copy())).numpy())
    assert yaw[-1] - yaw[0] == pytest.approx(np.radians(angle), abs=0.02)
    assert np.all(np.diff(yaw) * np.sign(angle) > -0.02)  # and never back


def test_crouches_when_it_says_so() -> None:
    assert np.median(CLIPS["crouch_walk"].qpos[:, 2]) < 0.66 < 0.72 < np.median(CLIPS["walk_forward"].qpos[:, 2])


def test_jumps_off_and_lands_with_both_feet() -> None:
    path = centre_of_mass(CLIPS["jump"])
    (flight,) = flights(CLIPS["jump"])
    assert path[:, 2].argmax() in range(flight.start, flight.stop)
    assert path[flight, 2].max() - path[0, 2] > 0.15  # [m]
    assert path[: flight.start, 2].min() < path[0, 2] - 0.06  # it has crouched
    assert path[flight.stop :, 2].min() < path[-1, 2] - 0.04  # and gives in landing


def test_free_fall_is_asked_of_the_body_and_of_the_ground() -> None:
    """In the air the height falls with gravity, the ground carries nothing, and nothing pulls the body aside."""
    pytest.importorskip("scipy", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored.timing import centre_of_mass as over
    from murmillo.envs.motion.authored.timing import free_fall, load_of

    airborne = np.zeros(91, bool)
    airborne[40:46] = True
    height = free_fall(np.full(91, 0.9), airborne, 30.0)
    np.testing.assert_allclose(np.diff(height, n=2)[39:45] * 900.0, -GRAVITY, atol=1e-3)
    np.testing.assert_allclose(height[[0, 1, -2, -1]], 0.9, atol=1e-3)
    load = load_of(height, 30.0)
    np.testing.assert_allclose(load[airborne], 0.0, atol=1e-3)
    assert load.mean() == pytest.approx(1.0, abs=0.02)  # what the flight takes from the load, the stances carry

    pressure = np.zeros((91, 2))
    pressure[43:, 0] = 0.5
    path = over(pressure, 0.9, 30.0, load)
    np.testing.assert_allclose(np.diff(path, n=2, axis=0)[39:45] * 900.0, 0.0, atol=0.1)


def test_a_foot_leaves_when_the_other_has_landed_or_flies_before() -> None:
    """Footfalls at 1.0, 1.5 and 2.0 s: both stand for 0.1 s after the first, the body flies for 0.2 s to the second."""
    pytest.importorskip("mink", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored.body import Pose
    from murmillo.envs.motion.authored.feet import Place
    from murmillo.envs.motion.authored.gait import RUNNING, Carriage, Footfall, keys_between, steps_between

    falls = [
        Footfall("right", 1.0, Place(0.5, -0.1), -0.1),
        Footfall("left", 1.5, Place(1.0, 0.1), 0.2),
        Footfall("right", 2.0, Place(1.5, -0.1), swing=RUNNING),
    ]
    steps = steps_between(falls, start=0.6)
    assert [(step.foot, step.end) for step in steps] == [("right", 1.0), ("left", 1.5), ("right", 2.0)]
    assert [step.start for step in steps] == pytest.approx([0.6, 1.1, 1.3])
    when, x, y, _, _ = np.array(steps[2].flow).T
    np.testing.assert_allclose(when, 1.3 + 0.7 * np.array([phase for phase, *_ in RUNNING.legs]))
    assert np.all(np.diff(x) > 0.0)
    np.testing.assert_allclose(y, -0.1)
    keys = keys_between(Carriage(Pose(), rise=0.03), falls)
    assert [key.time for key in keys] == pytest.approx([1.0, 1.25, 1.5, 1.75, 2.0])
    assert [key.pose.height - Pose().height for key in keys] == pytest.approx([0.0, 0.03, 0.0, 0.03, 0.0])


def test_a_running_foot_flows_onto_the_ground() -> None:
    """It swings through its places, meets the ground at the speed of touchdown, and rolls flat where it landed."""
    pytest.importorskip("scipy", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored.feet import SOLE, TOUCHDOWN, Place, Step, foot_path

    through = (0.8, 0.5, 0.1, 0.4, 0.0)
    step = Step("left", 0.5, 1.0, Place(1.0, 0.1), push=40.0, strike=0.0, flow=(through,))
    time = np.linspace(0.0, 1.2, 12001)
    path = foot_path("left", Place(0.0, 0.1), [step], time)
    np.testing.assert_allclose(path.ankle[8000], through[1:4], atol=1e-6)
    landing = np.diff(path.ankle[9997:9999], axis=0)[0] * 10000.0
    np.testing.assert_allclose(landing, [TOUCHDOWN[0], 0.0, TOUCHDOWN[1]], atol=0.02)  # [m/s]
    np.testing.assert_allclose(path.ankle[[0, -1]], [[0.0, 0.1, SOLE], [1.0, 0.1, SOLE]], atol=1e-9)
    assert (path.planted == ((time <= 0.5) | (time >= 1.0))).all()


def test_pelvis_sinks_where_a_leg_would_be_overstretched() -> None:
    pytest.importorskip("mink", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from scipy.spatial.transform import Rotation

    from murmillo.envs.motion.authored.feet import foot_path
    from murmillo.envs.motion.authored.take import HIP_OFFSET, REACH, STANCE, _overreach

    feet = {side: foot_path(side, place, [], np.arange(31) / 30.0) for side, place in STANCE.items()}
    pelvis, level = np.tile([0.0, 0.0, 0.95], (31, 1)), Rotation.identity(31)
    sunk = pelvis - _overreach(pelvis, level, feet)[:, None] * [0.0, 0.0, 1.0]
    lengths = [np.linalg.norm(path.ankle - sunk - [0.0, HIP_OFFSET[side], 0.0], axis=1) for side, path in feet.items()]
    np.testing.assert_allclose(np.max(lengths, axis=0), REACH, atol=1e-6)
    assert not _overreach(pelvis - [0.0, 0.0, 0.2], level, feet).any()
