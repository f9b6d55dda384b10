"""The built-in blows, blocks and stances do what their names say."""

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
import pytest

from murmillo.envs.character import load_character
from murmillo.envs.motion import load_clips

CHARACTER = load_character("sword_shield")
MODEL = CHARACTER.model
CLIPS = {clip.name: clip for clip in load_clips("builtin", CHARACTER)}

COMBAT = [
    *("guard", "idle_relaxed", "idle_alert"),
    *("slash_down", "slash_up", "slash_left", "slash_right", "stab", "parry"),
    *("combo_diagonal", "combo_cross", "spin_attack"),
    *("shield_bash", "swipe", "kick", "taunt", "roar"),
    *("block_high", "block_low", "block_left", "block_right", "block_crouched"),
]
DIRECTIONS = {  # to the left and up
    "left": (1.0, 0.0),
    "right": (-1.0, 0.0),
    "up": (0.0, 1.0),
    "down": (0.0, -1.0),
    "down right": (-0.7, -0.7),
    "up left": (0.7, 0.7),
}
HELD = 0.6  # when a block is up and waits for the blow [s]


@dataclass(frozen=True)
class Seen:
    """A clip seen from outside, world frame, by frame F: the tip, the blade and its edge, the shield's centre and the
    way it faces, the head's crown, the pelvis and the right foot, all [F, 3] [m] or unit vectors; blade to shield [F]
    and the deepest contact between own bodies [F] [m]."""

    tip: np.ndarray
    blade: np.ndarray
    edge: np.ndarray
    shield: np.ndarray
    face: np.ndarray
    crown: np.ndarray
    pelvis: np.ndarray
    foot: np.ndarray
    clearance: np.ndarray
    depth: np.ndarray

    def speed(self, path: np.ndarray) -> np.ndarray:
        """Of a path [F, 3], by frame [F] [m/s]."""
        return np.linalg.norm(np.gradient(path, 1.0 / 30.0, axis=0), axis=-1)


@cache
def see(name: str) -> Seen:
    data = mujoco.MjData(MODEL)
    frames = []
    for qpos in CLIPS[name].qpos:
        data.qpos = qpos
        mujoco.mj_forward(MODEL, data)
        hand = data.body("right_hand").xmat.reshape(3, 3)
        own = [-contact.dist for contact in data.contact if 0 not in MODEL.geom_bodyid[list(contact.geom)]]
        frames.append(
            (
                data.site("key_sword").xpos.copy(),
                hand[:, 0].copy(),
                -hand[:, 2],
                data.site("key_shield").xpos.copy(),
                data.site("key_shield").xmat.reshape(3, 3)[:, 1].copy(),
                data.body("head").xpos + data.body("head").xmat.reshape(3, 3)[:, 2] * 0.3,
                data.body("pelvis").xpos.copy(),
                data.body("right_foot").xpos.copy(),
                mujoco.mj_geomDistance(MODEL, data, MODEL.geom("shield").id, MODEL.geom("blade").id, 1.0, None),
                max(own, default=0.0),
            )
        )
    return Seen(*(np.array(column) for column in zip(*frames, strict=True)))


def strokes(name: str) -> list[np.ndarray]:
    """The frames of each cut: the tip faster than 6 m/s, within reach of an enemy ahead, the edge leading."""
    seen = see(name)
    velocity = np.gradient(seen.tip, 1.0 / 30.0, axis=0)
    across = velocity - np.sum(velocity * seen.blade, -1, keepdims=True) * seen.blade
    leading = np.sum(across * seen.edge, -1) > 0.7 * np.linalg.norm(across, axis=-1)
    cutting = leading & (seen.speed(seen.tip) > 6.0) & (seen.tip[:, 0] - seen.pelvis[:, 0] > 0.6)
    runs = np.split(np.arange(len(cutting)), np.flatnonzero(np.diff(cutting)) + 1)
    return [run for run in runs if cutting[run[0]]]


def azimuth(vectors: np.ndarray) -> np.ndarray:
    """Of vectors [..., 3], to the left of ahead [deg]."""
    return np.degrees(np.arctan2(vectors[..., 1], vectors[..., 0]))


def test_combat_skills_are_all_there() -> None:
    assert set(COMBAT) <= set(CLIPS)
    assert sum(CLIPS[name].duration for name in COMBAT) >= 65.0
    assert all(2.0 <= CLIPS[name].duration <= 5.0 for name in COMBAT)


@pytest.mark.parametrize("name", COMBAT)
def test_nothing_passes_through_the_body(name: str) -> None:
    assert see(name).depth.max() < 0.015  # [m]


@pytest.mark.parametrize(
    ("name", "directions"),
    [
        ("slash_down", ["down"]),
        ("slash_up", ["up"]),
        ("slash_left", ["left"]),
        ("slash_right", ["right"]),
        ("combo_diagonal", ["down right", "up left"]),
        ("combo_cross", ["left", "right", "down"]),
    ],
)
def test_tip_goes_the_way_the_name_says(name: str, directions: list[str]) -> None:
    """Edge first, on an arc through the space in front, for 0.1 to 0.3 s a cut."""
    seen, cuts = see(name), strokes(name)
    assert len(cuts) == len(directions)
    for cut, direction in zip(cuts, directions, strict=True):
        way = (seen.tip[cut[-1]] - seen.tip[cut[0]])[1:]
        assert np.linalg.norm(way) > 0.9  # [m]
        assert way @ np.array(DIRECTIONS[direction]) > 0.8 * np.linalg.norm(way)
        assert 0.1 <= len(cut) / 30.0 <= 0.3
        assert seen.speed(seen.tip)[cut].max() > 9.0  # [m/s]


@pytest.mark.parametrize("name", ["stab", "parry"])
def test_thrust_drives_the_point_forward(name: str) -> None:
    """Along the blade, straight ahead, fast."""
    seen = see(name)
    far = int(seen.tip[:, 0].argmax())
    velocity = np.gradient(seen.tip, 1.0 / 30.0, axis=0)
    fastest = far - 10 + int(velocity[far - 10 : far, 0].argmax())
    speed = np.linalg.norm(velocity[fastest])
    assert speed > 2.5  # [m/s]
    assert velocity[fastest, 0] > 0.9 * speed  # where a blade that wagged would be thrown up or aside
    assert velocity[fastest] @ seen.blade[fastest] > 0.9 * speed
    assert seen.tip[far, 0] - see("guard").tip[0, 0] > 0.5


def test_parry_beats_to_the_left_before_it_thrusts() -> None:
    tip = see("parry").tip
    beat = slice(10, 21)
    assert tip[beat][-1, 1] - tip[beat][0, 1] > 0.4
    assert tip[beat, 2].min() > 1.4
    assert tip[:, 0].argmax() > 30


def test_spin_goes_once_round_on_its_feet() -> None:
    rotation = CLIPS["spin_attack"].qpos[:, 3:7]
    w, x, y, z = rotation.T
    yaw = np.degrees(np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2))))
    assert yaw[-1] - yaw[0] == pytest.approx(360.0, abs=1.0)
    assert np.diff(yaw[15:50]).min() > 0.0  # never back, once it turns
    last = strokes("spin_attack")[-1]
    assert np.ptp(see("spin_attack").tip[last, 1]) > 0.8
    assert yaw[last[-1]] - yaw[0] > 330.0
    tip = see("spin_attack").tip - see("spin_attack").pelvis
    assert np.degrees(np.ptp(np.unwrap(np.arctan2(tip[:, 1], tip[:, 0])))) > 360.0


@pytest.mark.parametrize("name", ["block_high", "block_low", "block_left", "block_right", "block_crouched"])
def test_block_puts_the_shield_where_its_name_says(name: str) -> None:
    frame = round((1.0 if name == "block_crouched" else HELD) * 30)
    seen, guard = see(name), see("guard")
    place, face = seen.shield[frame], seen.face[frame]
    moved = place - guard.shield[0]
    if name == "block_high":
        assert moved[2] > 0.25
        assert face[2] > 0.5
        assert place[2] > seen.crown[frame, 2] - 0.15
    elif name == "block_low":
        assert moved[2] < -0.3
        assert place[2] - 0.3 < 0.45  # the rim comes down to the knee
        assert abs(azimuth(face)) < 30.0
    elif name == "block_left":
        assert moved[1] > 0.1
        assert azimuth(face) > 50.0
    elif name == "block_right":
        assert moved[1] < -0.15
        assert place[1] < seen.pelvis[frame, 1] - 0.05
        assert azimuth(face) < -30.0
    else:
        assert seen.pelvis[frame, 2] < guard.pelvis[0, 2] - 0.18
        assert abs(azimuth(face)) < 25.0
        assert seen.crown[frame, 2] < place[2] + 0.45  # little of the head shows over the rim


def test_block_gives_under_the_blow() -> None:
    """What takes a blow moves away from it, then comes back."""
    for name in ("block_high", "block_low", "block_left", "block_right", "block_crouched"):
        hit, until = (36, 48) if name == "block_crouched" else (24, 36)
        given = (see(name).shield[hit:until] - see(name).shield[hit - 4]) @ see(name).face[hit - 4]
        assert given.min() < -0.015
        assert given[-1] > 0.5 * given.min()


def test_bash_drives_the_face_and_swipe_the_rim() -> None:
    for name, low, high in (("shield_bash", 0.7, 1.0), ("swipe", 0.0, 0.65)):
        seen = see(name)
        strike = slice(15, 28)
        fastest = 15 + int(seen.speed(seen.shield)[strike].argmax())
        velocity = np.gradient(seen.shield, 1.0 / 30.0, axis=0)[fastest]
        assert np.linalg.norm(velocity) > 1.5  # [m/s]
        assert low <= velocity @ seen.face[fastest] / np.linalg.norm(velocity) <= high
    assert np.ptp(see("shield_bash").shield[12:24, 0]) > 0.25
    swipe = see("swipe").shield
    assert swipe[27, 1] - swipe[15, 1] > 0.4


def test_kick_reaches_out_at_the_height_of_the_belly() -> None:
    seen = see("kick")
    far = int((seen.foot - seen.pelvis)[:, 0].argmax())
    assert seen.foot[far, 0] - seen.pelvis[far, 0] > 0.65
    assert seen.foot[far, 2] > 0.55


def test_taunt_beats_the_shield_twice_without_cutting_it() -> None:
    near = see("taunt").clearance[: round(1.5 * 30)]
    beats = [i for i in range(1, len(near) - 1) if near[i] <= near[i - 1] and near[i] < near[i + 1] and near[i] < 0.02]
    assert len(beats) == 2
    assert near.min() > -0.01


def test_roar_opens_the_arms_and_throws_back_the_head() -> None:
    seen, guard = see("roar"), see("guard")
    hand = seen.tip - 0.74 * seen.blade
    frame = round(1.7 * 30)
    assert np.linalg.norm(hand[frame] - seen.shield[frame]) > 0.95
    assert seen.crown[frame, 0] - seen.pelvis[frame, 0] < guard.crown[0, 0] - guard.pelvis[0, 0] - 0.1


def test_stances_differ_in_height() -> None:
    height = {name: see(name).pelvis[:, 2] for name in ("guard", "idle_relaxed", "idle_alert")}
    assert height["idle_alert"].min() < height["guard"].min() - 0.02
    assert height["idle_relaxed"].max() > height["guard"].max() + 0.03
