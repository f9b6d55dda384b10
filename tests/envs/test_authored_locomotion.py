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
