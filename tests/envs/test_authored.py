"""The built-in clips: what each must measure to be worth learning from, and that the generator still makes them."""

from pathlib import Path

import numpy as np
import pytest
import torch

from murmillo.envs.character import Character, load_character
from murmillo.envs.motion import Clip, load_clips
from murmillo.envs.motion.measures import measure, tracking_error

CHARACTER = load_character("sword_shield")
CLIPS = {clip.name: clip for clip in load_clips("builtin", CHARACTER)}
HUMANOID = load_character("humanoid")
GAITS = {clip.name: clip for clip in load_clips("builtin", HUMANOID)}
TO_OR_FROM_THE_GROUND = {"fall_back", "fall_front", "get_up_back", "get_up_front"}


def test_pack_has_the_promised_skills() -> None:
    assert len({clip.label for clip in CLIPS.values()}) >= 32
    assert sum(clip.duration for clip in CLIPS.values()) >= 120.0
    for clip in CLIPS.values():
        assert clip.fps == 30.0
        assert 2.0 <= clip.duration <= 7.2
        assert (clip.licence, clip.redistributable) == ("CC0-1.0", True)


def test_gaits_of_the_humanoid_close() -> None:
    """Short styles and longer gaits, each a loop: the last pose is the first, a whole way further on."""
    assert {"walk", "run", "stoop", "limp", "march", "strut", "penguin", "jaunty"} <= set(GAITS)
    for clip in GAITS.values():
        assert (clip.fps, clip.licence, clip.redistributable, clip.loop) == (30.0, "CC0-1.0", True, True)
        assert 1.0 <= clip.duration <= (6.0 if clip.name in ("walk", "run") else 3.0)
        np.testing.assert_allclose(clip.qpos[-1, 1:], clip.qpos[0, 1:], atol=1e-6)
        joints = HUMANOID.joint_coordinates(torch.from_numpy(clip.qpos.copy())).numpy()
        step = np.diff(np.concatenate([joints[-2:-1], joints[:2]]), axis=0)  # into the first frame, and out of it
        assert np.abs(step[1] - step[0]).max() * clip.fps < 10.0  # [rad/s]


def test_walk_moves_as_people_do() -> None:
    """Peaks of hip, knee and ankle near Winter's (1991) natural walk; a foot stands for 60 % of the stride."""
    clip = GAITS["walk"]
    joints = np.degrees(HUMANOID.joint_coordinates(torch.from_numpy(clip.qpos.copy())).numpy())
    hip, knee, ankle = (
        joints[:33, next(joint.action for joint in HUMANOID.joints if joint.name == f"right_{name}")][:, axis]
        for name, axis in (("hip", 1), ("knee", 0), ("ankle", 1))
    )
    assert 20.0 < -hip.min() < 35.0
    assert 5.0 < hip.max() < 16.0
    assert 50.0 < knee.max() < 70.0
    assert 0.65 < knee.argmax() / 33 < 0.80
    assert 8.0 < -ankle.min() < 20.0
    assert 8.0 < ankle.max() < 24.0
    pos, _ = HUMANOID.forward_kinematics(torch.from_numpy(clip.qpos.copy()))
    ankle_w = pos[:34, HUMANOID.body_ids(("right_foot",))[0]].numpy()
    standing = np.linalg.norm(np.diff(ankle_w, axis=0), axis=1) * 30.0 < 1.0  # [m/s]
    assert 0.5 < standing.mean() < 0.7


@pytest.mark.parametrize("name", GAITS)
def test_gait_is_sound(name: str) -> None:
    jump = 13.0 if name == "run" else 10.0  # ASE's recorded run has 12
    _check_sound(GAITS[name], HUMANOID, jump, every=1)  # fewer starts would fall on the same phases of each stride


@pytest.mark.parametrize("name", CLIPS)
def test_clip_is_sound(name: str) -> None:
    _check_sound(CLIPS[name], CHARACTER, jump=10.0, every=3)


def _check_sound(clip: Clip, character: Character, jump: float, every: int) -> None:
    measures = measure(clip, character, every)
    assert measures.slide < 0.01  # [m] a frame
    assert measures.lowest > -0.01  # [m]
    assert measures.beyond_limits < 1e-3  # [rad]
    assert measures.speed < 25.0  # [rad/s]
    assert measures.jump < jump  # [rad/s] from one frame to the next
    assert measures.tracked >= 0.9


@pytest.mark.parametrize("name", [name for name in CLIPS if name not in TO_OR_FROM_THE_GROUND])
def test_clip_starts_and_ends_in_guard(name: str) -> None:
    """What a loop must, and what lets any skill follow any other."""
    measures = measure(CLIPS[name], CHARACTER, every=1000)
    assert measures.closure < (0.01 if CLIPS[name].loop else 0.05)  # [rad]
    first, guard = CLIPS[name].qpos[0], CLIPS["guard"].qpos[0]
    np.testing.assert_allclose(first[2:], guard[2:], atol=0.05)


def test_sword_leads_the_slash_on_an_arc() -> None:
    """The tip of a downward slash passes above the head, then in front of the belly, faster than any hand."""
    clip = CLIPS["slash_down"]
    keys = CHARACTER.key_positions(torch.from_numpy(clip.qpos.copy())).numpy()
    tip = keys[:, CHARACTER.key_bodies.index("sword")]
    hand = keys[:, CHARACTER.key_bodies.index("right_hand")]
    strike = slice(14, 28)
    assert tip[strike, 2].max() > 1.8
    assert tip[strike, 2].min() < 0.8
    speed = np.linalg.norm(np.diff(tip, axis=0), axis=1).max() * clip.fps
    assert speed > 1.5 * np.linalg.norm(np.diff(hand, axis=0), axis=1).max() * clip.fps
    assert 5.0 < speed < 25.0  # [m/s]


def test_measures_see_a_broken_clip() -> None:
    """Sunk by 3 cm, slid by 2 cm a frame, and thrown about by random joints: each is seen."""
    clip = CLIPS["guard"]
    sunk, slid, thrown = (clip.qpos[:31].copy() for _ in range(3))
    sunk[:, 2] -= 0.03
    slid[:, 0] += 0.02 * np.arange(len(slid))
    coordinates = np.random.default_rng(0).uniform(-1.0, 1.0, (len(thrown), 4))
    thrown[:, 15:19] = coordinates / np.linalg.norm(coordinates, axis=1, keepdims=True)

    def of(qpos: np.ndarray) -> Clip:
        return Clip("broken", clip.character, clip.fps, qpos, "guard", "test", "CC0-1.0", True)

    assert measure(of(sunk), CHARACTER, every=1000).lowest == pytest.approx(-0.03, abs=1e-3)
    assert measure(of(slid), CHARACTER, every=1000).slide == pytest.approx(0.02, abs=1e-3)
    assert measure(of(thrown), CHARACTER, every=1000).jump > 25.0
    assert tracking_error(of(thrown), CHARACTER, every=10).mean() > 0.15


def test_motion_between_keys_does_not_overshoot() -> None:
    pytest.importorskip("scipy", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored.timing import through_keys

    times, values = np.array([0.0, 0.5, 0.6, 1.5]), np.array([[0.0], [1.0], [1.9], [2.0]])
    path = through_keys(times, values, np.linspace(0.0, 1.5, 1501))[:, 0]
    assert np.all(np.diff(path) >= -1e-12)
    np.testing.assert_allclose(path[[0, 500, 600, 1500]], [0.0, 1.0, 1.9, 2.0], atol=1e-12)


def test_centre_of_mass_obeys_the_cart_on_a_table() -> None:
    """p = c - (h / g) c'' holds inside, and the body rests over the pressure at both ends."""
    pytest.importorskip("scipy", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored.timing import centre_of_mass

    pressure = np.zeros((181, 2))
    pressure[90:, 0] = 0.3
    path = centre_of_mass(pressure, height=0.9, rate=30.0)
    acceleration = np.diff(path[:, 0], n=2) * 30.0**2
    np.testing.assert_allclose(path[1:-1, 0] - 0.9 / 9.81 * acceleration, pressure[1:-1, 0], atol=1e-3)
    assert path[89, 0] == pytest.approx(0.15, abs=0.02)  # it has begun to fall before the step
    np.testing.assert_allclose(path[[0, 1, -2, -1], 0], [0.0, 0.0, 0.3, 0.3])


def test_packs_are_what_the_generator_lists() -> None:
    pytest.importorskip("mink", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored.skills import SKILLS
    from murmillo.envs.motion.authored.styles import GAITS as STYLES

    assert [skill().label for skill in SKILLS] == list(CLIPS)
    assert [gait().label for gait in STYLES] == list(GAITS)


@pytest.mark.parametrize("name", ["shield_bash", "kick", "dodge_left", "guard", "fall_front"])
def test_generator_makes_the_shipped_clip(name: str) -> None:
    """A blow on planted feet, a foot led through the air, a flight, a loop and a fall."""
    pytest.importorskip("mink", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored.generate import generate
    from murmillo.envs.motion.authored.skills import SKILLS

    made = generate(next(skill for skill in SKILLS if skill.__name__ == name)(), CHARACTER)
    np.testing.assert_allclose(made.qpos, CLIPS[name].qpos, atol=1e-4)
    assert made.loop is CLIPS[name].loop


def test_command_writes_a_pack(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    pytest.importorskip("mink", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored import __main__ as command
    from murmillo.envs.motion.authored.styles import penguin

    monkeypatch.setitem(command.PACKS, "humanoid", (penguin,))
    command.main(["--character", "humanoid", "--out", str(tmp_path)])
    (made,) = load_clips(str(tmp_path / "humanoid"), HUMANOID)
    np.testing.assert_allclose(made.qpos, GAITS["penguin"].qpos, atol=1e-6)
    assert "1 clips, 2.1 s" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["humanoid"]


@pytest.mark.parametrize("name", ["walk", "limp"])
def test_generator_makes_the_shipped_gait(name: str) -> None:
    pytest.importorskip("mink", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored import styles
    from murmillo.envs.motion.authored.generate import generate

    made = generate(getattr(styles, name)(), HUMANOID)
    np.testing.assert_allclose(made.qpos, GAITS[name].qpos, atol=1e-6)


def test_leg_puts_the_foot_where_it_is_asked() -> None:
    """Closed-form hip, knee and ankle against the character's own kinematics."""
    pytest.importorskip("scipy", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from scipy.spatial.transform import Rotation

    from murmillo.envs.motion.authored.leg import Leg

    leg, rng = Leg(HUMANOID.model, "left"), np.random.default_rng(0)
    pelvis, foot = (Rotation.from_rotvec(rng.uniform(-0.3, 0.3, (16, 3))) for _ in range(2))
    root = rng.uniform(-1.0, 1.0, (16, 3))
    ankle = root + pelvis.apply(leg.hip) + rng.uniform([-0.3, -0.1, -0.75], [0.3, 0.1, -0.6], (16, 3))
    hip, knee, twist = leg.solve(pelvis, root + pelvis.apply(leg.hip), ankle, foot, np.zeros(16))
    coordinates = np.zeros((16, HUMANOID.action_dim))
    parts = {"left_hip": hip.as_rotvec(), "left_knee": knee[:, None], "left_ankle": twist.as_rotvec()}
    for joint in HUMANOID.joints:
        coordinates[:, joint.action] = parts.get(joint.name, 0.0)
    wished = (coordinates, root, pelvis.as_quat(scalar_first=True))
    pos, quat = HUMANOID.forward_kinematics(HUMANOID.pose(*(torch.from_numpy(part) for part in wished)))
    (body,) = HUMANOID.body_ids(("left_foot",))
    np.testing.assert_allclose(pos[:, body], ankle, atol=1e-9)
    turned = Rotation.from_quat(quat[:, body].numpy(), scalar_first=True)
    assert (foot.inv() * turned).magnitude().max() < 1e-9
