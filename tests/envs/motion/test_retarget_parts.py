"""The steps of retargeting, each by itself: resampling, planted feet, the solver's bounds, the grip, leaps, faults."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from murmillo.envs.character import Character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion import Clip
from murmillo.envs.motion.formats.quaternions import about_axis
from murmillo.envs.motion.formats.recording import Recording, Skeleton
from murmillo.envs.motion.ground import ground_of
from murmillo.envs.motion.retarget.anatomy import understand
from murmillo.envs.motion.retarget.feet import FootPath, find_standing, plant
from murmillo.envs.motion.retarget.figure import Figure
from murmillo.envs.motion.retarget.finishing import calmed
from murmillo.envs.motion.retarget.fit import find_faults
from murmillo.envs.motion.retarget.grip import grip
from murmillo.envs.motion.retarget.pose import Wish
from murmillo.envs.motion.retarget.retargeting import resampled
from murmillo.envs.motion.retarget.skeleton_map import REQUIRED
from murmillo.envs.motion.retarget.solve import Solver

FPS = 30.0


@pytest.fixture
def figure(character: Character) -> Figure:
    return Figure(character)


def clip_of(qpos: np.ndarray, character: Character) -> Clip:
    return Clip("clip", character.name, FPS, qpos, "clip", "made in a test", "CC0-1.0", redistributable=True)


def standing_pose(figure: Figure) -> np.ndarray:
    """The model's own pose [nq], its soles on the ground."""
    qpos = figure.character.model.qpos0.copy()
    lowest = ground_of(clip_of(np.stack([qpos, qpos]), figure.character), figure.character).height.min()
    qpos[2] -= lowest
    return qpos


def test_resampling_interpolates() -> None:
    """45 Hz to 30 Hz: every second frame of the new falls between two of the old."""
    frames = np.arange(10.0)
    skeleton = Skeleton(("root",), (-1,), np.zeros((1, 3)))
    old = Recording(
        "r", 45.0, skeleton, frames[:, None] * np.array([1.0, 2.0, 3.0]), about_axis(2, 0.1 * frames)[:, None]
    )
    new = resampled(old, FPS)
    when = 1.5 * np.arange(7)
    np.testing.assert_allclose(new.root_pos_w, when[:, None] * np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(new.quat[:, 0], about_axis(2, 0.1 * when))
    assert new.fps == FPS
    assert resampled(replace(old, fps=30.5), FPS).frames == 10


def test_a_trunk_without_length_is_refused() -> None:
    """Every joint has its place but the shoulders, which are where the hips are."""
    places = np.random.default_rng(0).standard_normal((len(REQUIRED), 3))
    index = {point: joint for joint, point in enumerate(REQUIRED)}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        places[index[f"{side}_hip"]], places[index[f"{side}_shoulder"]] = [0.0, 0.1 * sign, 0.0], [0.0, 0.2 * sign, 0.0]
    places[0] = 0.0
    parents = (-1, *(0 for _ in REQUIRED[1:]))
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (2, len(REQUIRED), 1))
    recording = Recording("folded", FPS, Skeleton(REQUIRED, parents, places), np.zeros((2, 3)), quat)
    with pytest.raises(MotionError, match=r"^folded: its trunk has no length"):
        understand(recording, index, 0.4)


def test_a_foot_that_stands_is_held_and_one_that_swings_is_clear_of_the_ground(figure: Figure) -> None:
    """Ten frames on the ground that slip, bob and turn a little, ten in the air that brush it, ten on the ground."""
    sole = figure.soles["left"]
    rng = np.random.default_rng(0)
    ankle = np.zeros((30, 3))
    ankle[10:20, 0] = np.linspace(0.04, 0.36, 10)
    ankle[20:, 0] = 0.4
    ankle[:, 2] = -sole.corners[:, 2].min()
    slip = np.where((np.arange(30) < 10) | (np.arange(30) >= 20), 1.0, 0.0)[:, None]
    ankle += slip * 0.004 * rng.standard_normal((30, 3))
    yaw = Rotation.from_euler("z", 0.02 * rng.standard_normal((30, 1)))
    path = plant(ankle, yaw, sole, FPS)
    corners = path.ankle[:, None] + np.stack([path.rotation.apply(corner) for corner in sole.corners], axis=1)
    for stance in (slice(1, 9), slice(21, 30)):
        assert path.standing[stance].all()
        np.testing.assert_allclose(corners[stance, :, 2], 0.0, atol=1e-12)
        np.testing.assert_allclose(np.diff(corners[stance], axis=0), 0.0, atol=1e-12)
    assert not path.standing[12:18].any()
    assert corners[12:18, :, 2].min() > 0.02 - 1e-9
    assert np.abs(path.ankle[:, :2] - ankle[:, :2]).max() < 0.02
    assert not find_standing(ankle + np.array([0.0, 0.0, 0.06]), yaw, sole, FPS).any()


def wish_of(qpos: np.ndarray, figure: Figure, hand_w: np.ndarray, standing: tuple[bool, bool]) -> Wish:
    """Hold the pose [nq] for a second, with the left wrist at `hand_w` [3]."""
    frames = np.tile(qpos, (30, 1))
    pos, quat = figure.forward_kinematics(frames)
    hands = pos[:, [figure.body("left_hand"), figure.body("right_hand")]].copy()
    hands[:, 0] = hand_w
    feet = pos[:, [figure.body("left_foot"), figure.body("right_foot")]]
    turns = [Rotation.from_quat(quat[:, figure.body(f"{s}_foot")], scalar_first=True) for s in ("left", "right")]
    paths = {side: FootPath(feet[:, i], turns[i], np.full(30, standing[i])) for i, side in enumerate(("left", "right"))}
    return Wish(1.0, hands, feet, frames, frames, paths)


@pytest.mark.parametrize("target", [[-0.6, -0.3, 1.2], [0.3, 0.2, -0.3]])
def test_the_solver_itself_keeps_bounds_and_ground(
    figure: Figure, monkeypatch: pytest.MonkeyPatch, target: list[float]
) -> None:
    """A hand that is asked behind the back or into the ground, without the clamp that comes after."""
    monkeypatch.setattr(figure, "clamped", lambda qpos: qpos)
    wish = wish_of(standing_pose(figure), figure, np.array(target), (True, True))
    solved = Solver(figure).solve(wish, "reach")
    assert figure.excess(solved).max() < 0.01
    height = ground_of(clip_of(solved, figure.character), figure.character).height
    assert height.min() > -0.002


def test_a_standing_foot_gives_way_less_than_a_swinging_one(figure: Figure) -> None:
    """The left one, when the left hand pulls."""
    strayed = {}
    for stands in (True, False):
        wish = wish_of(standing_pose(figure), figure, np.array([1.5, 0.2, 1.0]), (stands, True))
        pos, _ = figure.forward_kinematics(Solver(figure).solve(wish, "reach"))
        strayed[stands] = np.linalg.norm(pos[-1, figure.body("left_foot")] - wish.feet[-1, 0])
    assert strayed[True] < 0.6 * strayed[False], strayed


def test_the_blade_points_ahead_and_up(figure: Figure) -> None:
    """The arm hangs; the body looks to its left."""
    qpos = standing_pose(figure)[None]
    qpos[:, 3:7] = about_axis(2, 0.5 * np.pi)
    before = qpos.copy()
    held = grip(qpos, figure)
    np.testing.assert_array_equal(qpos, before)
    _, quat = figure.forward_kinematics(held)
    blade = Rotation.from_quat(quat[0, figure.body("right_hand")], scalar_first=True).apply([1.0, 0.0, 0.0])
    assert blade[1] > 0.9
    assert blade[2] > 0.1


def test_leaps_are_spread_and_other_frames_left_alone(figure: Figure) -> None:
    qpos = np.tile(standing_pose(figure), (40, 1))
    elbow = figure.joints["left_elbow"]
    qpos[20:, elbow.qpos] = -1.5
    calm = calmed(qpos, figure, FPS)
    rate = np.abs(np.diff(figure.coordinates(calm), axis=0)) * FPS
    assert rate.max() < 25.0
    np.testing.assert_allclose(calm[:8], qpos[:8], atol=1e-12)
    np.testing.assert_allclose(calm[-8:], qpos[-8:], atol=1e-12)


def test_a_foot_that_rolls_over_its_toes_does_not_slide(figure: Figure) -> None:
    """The whole body pitches about the front edge of its left sole: the heel moves, the toes do not."""
    start = standing_pose(figure)
    pos, _ = figure.forward_kinematics(start[None])
    toe = pos[0, figure.body("left_foot")] + figure.soles["left"].toe
    pitch = Rotation.from_euler("y", np.linspace(0.3, 1.0, 15)[:, None])
    qpos = np.tile(start, (15, 1))
    qpos[:, :3] = toe + pitch.apply(start[:3] - toe)
    qpos[:, 3:7] = pitch.as_quat(scalar_first=True)
    standing = np.tile([True, False], (15, 1))
    assert find_faults(clip_of(qpos, figure.character), standing, figure).slide < 1e-9
    qpos[:, 0] += 0.01 * np.arange(15)
    assert find_faults(clip_of(qpos, figure.character), standing, figure).slide == pytest.approx(0.01)
