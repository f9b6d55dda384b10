"""The built-in clips: what each must measure to be worth learning from, and that the generator still makes them."""

import numpy as np
import pytest
import torch

from murmillo.envs.character import load_character
from murmillo.envs.motion import Clip, load_clips
from murmillo.envs.motion.measures import measure, tracking_error

CHARACTER = load_character("sword_shield")
CLIPS = {clip.name: clip for clip in load_clips("builtin", CHARACTER)}


def test_pack_has_the_promised_skills() -> None:
    assert len({clip.label for clip in CLIPS.values()}) >= 12
    assert sum(clip.duration for clip in CLIPS.values()) >= 38.0
    for clip in CLIPS.values():
        assert clip.fps == 30.0
        assert 2.0 <= clip.duration <= 5.5
        assert (clip.licence, clip.redistributable) == ("CC0-1.0", True)


@pytest.mark.parametrize("name", CLIPS)
def test_clip_is_sound(name: str) -> None:
    measures = measure(CLIPS[name], CHARACTER, every=3)
    assert measures.slide < 0.01  # [m] a frame
    assert measures.lowest > -0.01  # [m]
    assert measures.beyond_limits < 1e-3  # [rad]
    assert measures.speed < 25.0  # [rad/s]
    assert measures.jump < 10.0  # [rad/s] from one frame to the next
    assert measures.tracked >= 0.9


@pytest.mark.parametrize("name", CLIPS)
def test_clip_starts_and_ends_in_guard(name: str) -> None:
    """What a loop must, and what lets any skill follow any other."""
    measures = measure(CLIPS[name], CHARACTER, every=1000)
    assert measures.closure < (0.01 if CLIPS[name].loop else 0.05)  # [rad]
    first, guard = CLIPS[name].qpos[0], CLIPS["guard"].qpos[0]
    np.testing.assert_allclose(first[2:], guard[2:], atol=0.03)


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


def test_generator_makes_the_shipped_clip() -> None:
    pytest.importorskip("mink", reason="the generator needs the motion extra: pip install murmillo[motion]")
    from murmillo.envs.motion.authored.generate import generate
    from murmillo.envs.motion.authored.skills.shield import shield_bash

    made = generate(shield_bash(), CHARACTER)
    np.testing.assert_allclose(made.qpos, CLIPS["shield_bash"].qpos, atol=2e-3)
