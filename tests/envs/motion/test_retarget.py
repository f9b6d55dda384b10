"""Retargeting: own motion comes back from strange skeletons, and real recordings keep ground and limits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from murmillo.envs.character import Character, load_character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion import Clip, load_clips
from murmillo.envs.motion.formats.reader import read_file
from murmillo.envs.motion.formats.recording import Recording, Skeleton
from murmillo.envs.motion.measures import measure
from murmillo.envs.motion.retarget import retarget

NAMES = {"pelvis": "Hips", "torso": "Chest", "head": "Head"} | {
    f"{side}_{body}": f"{name}_{side[0].upper()}"
    for side in ("left", "right")
    for body, name in {
        "upper_arm": "UpperArm",
        "lower_arm": "LowerArm",
        "hand": "Hand",
        "thigh": "UpperLeg",
        "shin": "LowerLeg",
        "foot": "Foot",
    }.items()
}
TOE = np.array([0.13, 0.0, -0.03])  # in the foot [m]
MADE_UP = ("sword", "shield")


@pytest.fixture(scope="module")
def clips(character: Character) -> dict[str, Clip]:
    return {clip.name: clip for clip in load_clips("builtin", character)}


def cut(clip: Clip, start: int, end: int) -> Clip:
    return replace(clip, qpos=clip.qpos[start:end])


def own_recording(clip: Clip, character: Character) -> Recording:
    """The clip as a recording of the character's own skeleton."""
    pos, quat = (x.numpy() for x in character.forward_kinematics(torch.from_numpy(clip.qpos.copy())))
    parents = tuple(int(parent) for parent in character.model.body_parentid[1:] - 1)
    turns = [Rotation.from_quat(quat[:, body], scalar_first=True) for body in range(len(parents))]
    local = [turn if p < 0 else turns[p].inv() * turn for turn, p in zip(turns, parents, strict=True)]
    offsets = character.model.body_pos[1:] * (np.array(parents) >= 0)[:, None]
    quats = np.stack([turn.as_quat(scalar_first=True) for turn in local], axis=1)
    return Recording(clip.name, clip.fps, Skeleton(character.bodies, parents, offsets), pos[:, 0], quats)


def disguised(clip: Clip, character: Character, scale: float = 0.8, seed: int | None = 3) -> Recording:
    """The same with other names, another size, toes, no arms in hand, and random axes of every joint; None: its own."""
    pos, quat = (x.numpy() for x in character.forward_kinematics(torch.from_numpy(clip.qpos.copy())))
    bodies = [body for body in character.bodies if body not in MADE_UP]
    ids = character.body_ids(tuple(bodies))
    parents = [int(character.model.body_parentid[1 + body]) - 1 for body in ids]
    turns = {body: Rotation.from_quat(quat[:, body], scalar_first=True) for body in ids}
    offsets = [character.model.body_pos[1 + body] for body in ids]
    names = [NAMES[body] for body in bodies]
    for side in ("left", "right"):
        foot = character.bodies.index(f"{side}_foot")
        toe = 100 + foot
        ids, parents, offsets = [*ids, toe], [*parents, foot], [*offsets, TOE]
        names.append(f"Toes_{side[0].upper()}")
        turns[toe] = turns[foot]
    turned = Rotation.identity(len(ids)) if seed is None else Rotation.random(len(ids), rng=np.random.default_rng(seed))
    axes = dict(zip(ids, turned, strict=True))
    quats, places = [], []
    for body, parent, offset in zip(ids, parents, offsets, strict=True):
        own = turns[body] * axes[body]
        local = own if parent < 0 else (turns[parent] * axes[parent]).inv() * own
        quats.append(local.as_quat(scalar_first=True))
        places.append(np.zeros(3) if parent < 0 else scale * axes[parent].inv().apply(offset))
    skeleton = Skeleton(tuple(names), tuple(-1 if p < 0 else ids.index(p) for p in parents), np.array(places))
    return Recording(clip.name, clip.fps, skeleton, scale * pos[:, 0], np.stack(quats, axis=1))


def joint_errors(a: Clip, b: Clip, character: Character) -> dict[str, float]:
    """Mean angle between two clips at each joint [rad]."""
    errors = {}
    for joint in character.joints:
        x, y = a.qpos[:, joint.qpos], b.qpos[:, joint.qpos]
        ball = joint.kind == "ball"
        angle = 2.0 * np.arccos(np.clip(np.abs(np.sum(x * y, axis=1)), 0.0, 1.0)) if ball else np.abs(x - y)
        errors[joint.name] = float(angle.mean())
    return errors


def test_the_characters_own_skeleton_is_copied_to_the_bit(clips: dict[str, Clip], character: Character) -> None:
    clip, fit = retarget(own_recording(clips["kick"], character), character)
    np.testing.assert_allclose(clip.qpos, clips["kick"].qpos, atol=1e-12)
    assert (fit.skeleton, fit.error_max, clip.masked) == ("own", 0.0, ())


@pytest.mark.parametrize(("name", "seed"), [("walk_forward", 3), ("kick", 4)])
def test_own_motion_comes_back_from_a_skeleton_with_other_axes_and_size(
    clips: dict[str, Clip], character: Character, name: str, seed: int
) -> None:
    wished = cut(clips[name], 0, 40)
    clip, fit = retarget(disguised(wished, character, 0.8, seed), character)
    errors = joint_errors(clip, wished, character)
    # where the head looks is not to be seen from a joint of unknown axes, and the sword hand is posed anew
    assert max(error for joint, error in errors.items() if joint not in ("neck", "right_wrist")) < 0.12, errors
    assert fit.scale == pytest.approx(1.25, rel=1e-3)
    assert fit.error_mean < 0.02
    assert clip.masked == MADE_UP
    heading = np.linalg.norm(clip.qpos[:, :2] - wished.qpos[:, :2], axis=1)
    assert heading.max() < 0.05  # it goes the same way


def test_own_motion_comes_back_head_and_all_from_a_skeleton_that_rests_upright(
    clips: dict[str, Clip], character: Character
) -> None:
    wished = cut(clips["kick"], 0, 20)
    clip, _ = retarget(disguised(wished, character, seed=None), character)
    errors = joint_errors(clip, wished, character)
    assert max(errors[joint] for joint in ("abdomen", "neck")) < 0.02, errors


def test_left_stays_left(clips: dict[str, Clip], character: Character) -> None:
    right = cut(clips["kick"], 0, 40)
    clip, _ = retarget(disguised(right, character), character)
    lift = {
        side: character.forward_kinematics(torch.from_numpy(clip.qpos.copy()))[0][
            :, character.bodies.index(f"{side}_foot"), 2
        ].max()
        for side in ("left", "right")
    }
    assert max(lift, key=lambda side: float(lift[side])) == "right"


def test_the_humanoid_has_nothing_to_mask(clips: dict[str, Clip], character: Character) -> None:
    humanoid = load_character("humanoid")
    clip, fit = retarget(disguised(cut(clips["walk_forward"], 0, 20), character), humanoid)
    assert (clip.character, clip.masked) == ("humanoid", ())
    assert fit.error_mean < 0.02


def test_faster_recordings_come_at_30_fps_unless_kept(clips: dict[str, Clip], character: Character) -> None:
    fast = replace(disguised(cut(clips["walk_forward"], 0, 21), character), fps=60.0)
    clip, _ = retarget(fast, character)
    assert (clip.fps, clip.frames) == (30.0, 11)
    clip, _ = retarget(fast, character, fps=None)
    assert (clip.fps, clip.frames) == (60.0, 21)


def test_standing_feet_do_not_slide_and_nothing_is_below_ground(clips: dict[str, Clip], character: Character) -> None:
    recording = disguised(cut(clips["walk_forward"], 0, 60), character)
    seconds = np.arange(60) / 30.0
    error = np.stack([0.08 * seconds, np.zeros(60), 0.012 * np.sin(5.0 * seconds)], axis=1)  # slips, and bobs
    shaken, fit = retarget(replace(recording, root_pos_w=recording.root_pos_w + error), character)
    assert fit.before.slide > 0.003
    assert fit.after.slide < 0.002
    assert fit.before.depth > 0.01
    measures = measure(shaken, character, every=None)
    assert measures.lowest > -1e-9
    assert measures.beyond_limits < 1e-9


def test_one_frame_is_no_clip(clips: dict[str, Clip], character: Character) -> None:
    recording = disguised(cut(clips["walk_forward"], 0, 2), character)
    with pytest.raises(MotionError, match=r"walk_forward: 1 frame at 30 Hz; a clip needs 2 or more"):
        retarget(replace(recording, root_pos_w=recording.root_pos_w[:1], quat=recording.quat[:1]), character)


@pytest.mark.parametrize(
    ("file", "skeleton"),
    [
        ("bandai_namco_bvh/dataset-1_kick_normal_001.bvh", "Bandai Namco Research"),
        ("cmu_asf_amc/02_04.amc", "CMU Acclaim"),
        ("deepmimic/humanoid3d_spinkick.txt", "DeepMimic humanoid"),
        ("walk_run_lafan1/iccgan/jaunty_walk.json", "ASE and AMP humanoid"),
    ],
)
def test_real_recordings_keep_limits_and_ground(
    shared_motions: Path, character: Character, file: str, skeleton: str
) -> None:
    recording = read_file(shared_motions / file)
    frames = slice(0, round(1.5 * recording.fps))
    recording = replace(recording, root_pos_w=recording.root_pos_w[frames], quat=recording.quat[frames])
    clip, fit = retarget(recording, character)
    assert fit.skeleton == skeleton
    assert fit.error_mean < 0.025
    assert fit.after.slide < 0.004
    measures = measure(clip, character, every=None)
    assert measures.lowest > -1e-9
    assert measures.beyond_limits < 1e-9
    assert measures.speed < 25.0
