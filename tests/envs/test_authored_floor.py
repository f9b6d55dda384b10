"""Falls and get-ups of the built-in pack: where they begin and end, and what they obey."""

import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs.character import load_character
from murmillo.envs.motion import load_clips
from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.measures import measure

CHARACTER = load_character("sword_shield")
CLIPS = {clip.name: clip for clip in load_clips("builtin", CHARACTER)}
WAYS = {"back": 1.0, "front": -1.0}  # whether the chest looks up at the end of the fall
NAMES = [f"{skill}_{way}" for skill in ("fall", "get_up") for way in WAYS]


def _joints(qpos: np.ndarray) -> np.ndarray:
    return CHARACTER.joint_coordinates(torch.from_numpy(qpos.copy())).numpy()


def _chest_up(qpos: np.ndarray) -> float:
    """How far the chest looks up, from -1 to 1."""
    data = mujoco.MjData(CHARACTER.model)
    data.qpos = qpos
    mujoco.mj_kinematics(CHARACTER.model, data)
    return float(data.body("torso").xmat.reshape(3, 3)[2, 0])


def _assert_in_guard(qpos: np.ndarray) -> None:
    guard = CLIPS["guard"].qpos[0]
    np.testing.assert_allclose(_joints(qpos), _joints(guard), atol=0.05)  # [rad]
    np.testing.assert_allclose(qpos[2:7], guard[2:7], atol=0.03)  # height and attitude; heading ahead


@pytest.mark.parametrize("way", WAYS)
def test_fall_goes_from_guard_to_lying_still(way: str) -> None:
    clip = CLIPS[f"fall_{way}"]
    _assert_in_guard(clip.qpos[0])
    assert clip.qpos[-1, 2] < 0.2  # [m]
    assert WAYS[way] * _chest_up(clip.qpos[-1]) > 0.8
    assert np.abs(np.diff(_joints(clip.qpos[-3:]), axis=0)).max() * clip.fps < 0.3  # [rad/s]


@pytest.mark.parametrize("way", WAYS)
def test_get_up_goes_from_where_the_fall_ended_to_guard(way: str) -> None:
    fall, clip = CLIPS[f"fall_{way}"], CLIPS[f"get_up_{way}"]
    np.testing.assert_allclose(_joints(clip.qpos[0]), _joints(fall.qpos[-1]), atol=0.02)  # [rad]
    np.testing.assert_allclose(clip.qpos[0, :7], fall.qpos[-1, :7], atol=0.01)
    _assert_in_guard(clip.qpos[-1])


@pytest.mark.parametrize("name", NAMES)
def test_sword_shield_and_limbs_pass_through_nothing(name: str) -> None:
    """MuJoCo finds no contact of the body with itself that is deeper than a centimetre."""
    model = CHARACTER.model
    data = mujoco.MjData(model)
    for qpos in CLIPS[name].qpos:
        data.qpos = qpos
        mujoco.mj_fwdPosition(model, data)
        assert min(data.contact.dist, default=0.0) > -0.01  # [m]


@pytest.mark.parametrize("way", WAYS)
def test_fall_is_no_faster_than_gravity(way: str) -> None:
    """The centre of mass sinks by a good half metre within a second, never accelerated much beyond free fall."""
    clip = CLIPS[f"fall_{way}"]
    height = _centre_height(clip)
    acceleration = np.diff(height, n=2) * clip.fps**2
    assert acceleration.min() > -1.2 * 9.81  # [m/s^2]
    assert (height[:-30] - height[30:]).max() > 0.5  # [m]


def _centre_height(clip: Clip) -> np.ndarray:
    data = mujoco.MjData(CHARACTER.model)
    heights = np.empty(clip.frames)
    for frame, qpos in enumerate(clip.qpos):
        data.qpos = qpos
        mujoco.mj_kinematics(CHARACTER.model, data)
        mujoco.mj_comPos(CHARACTER.model, data)
        heights[frame] = data.subtree_com[1, 2]
    return heights


def test_pose_asked_for_below_the_ground_lies_on_it() -> None:
    pytest.importorskip("mink", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored.tumbler import Low, Tumbler

    lean = (0.0, -88.0, 0.0)
    sunk = Low(pelvis=(0.0, 0.0, -0.1), hips=lean, chest=lean, head=lean, points={"right_hand": (-0.5, -0.5, -0.1)})
    qpos = Tumbler(CHARACTER).pose(sunk)
    still = Clip("sunk", CHARACTER.name, 30.0, np.stack([qpos, qpos]), "fall", "test", "CC0-1.0", True)
    assert measure(still, CHARACTER).lowest == pytest.approx(0.0, abs=2e-3)  # [m]
