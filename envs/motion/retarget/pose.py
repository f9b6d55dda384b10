"""The pose of a character that follows a human body, in closed form: joint limits and ground are not seen to here."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from murmillo.envs.motion.retarget.anatomy import LIMBS, Anatomy, Limb, upper_frames
from murmillo.envs.motion.retarget.bases import Floats, basis_zy, unit
from murmillo.envs.motion.retarget.feet import FootPath, foot_rotation, ground_height, plant, sinking
from murmillo.envs.motion.retarget.figure import Figure, LimbFigure, relative
from murmillo.envs.motion.retarget.skeleton_map import SIDES

_REACH = 0.997  # share of a leg's length that it is stretched to


@dataclass(frozen=True)
class Wish:
    """What the character should do.

    Attributes:
        scale: the character's leg by the recording's.
        hands, feet: [F, 2, 3] where the recording, in the character's size, has its left and right wrist and ankle [m].
        qpos: [F, nq] the pose that comes nearest to it with the feet planted.
        unplanted: [F, nq] the same before the feet were planted.
        paths: the planted feet, by side.
    """

    scale: float
    hands: Floats
    feet: Floats
    qpos: Floats
    unplanted: Floats
    paths: dict[str, FootPath]


def make_wish(body: Anatomy, figure: Figure, fps: float) -> Wish:
    """Pose the character as the body; sizes by the length of the legs, so that a foot that stands stays where it is."""
    scale = figure.leg / body.leg
    uppers = {name: upper_frames(limb, figure.limbs[name].bend) for name, limb in body.limbs.items()}
    ankles = {side: scale * body.feet[side].ankle for side in SIDES}
    turns = {}
    for side in SIDES:
        leg = f"{side}_leg"
        shin = uppers[leg] * _hinge_turn(uppers[leg], body.limbs[leg], figure.limbs[leg])[1]
        turns[side] = foot_rotation(body.feet[side], shin, scale, fps)
    ground = np.array([0.0, 0.0, ground_height([(ankles[s], turns[s], figure.soles[s]) for s in SIDES], fps)])
    hips = scale * body.hips - ground
    ankles = {side: ankle - ground for side, ankle in ankles.items()}
    paths = {side: plant(ankles[side], turns[side], figure.soles[side], fps) for side in SIDES}
    loose = {side: FootPath(ankles[side], turns[side], paths[side].standing) for side in SIDES}
    roots = np.stack([hips + body.pelvis.apply(figure.limbs[f"{side}_leg"].root) for side in SIDES], axis=1)
    sunk = hips.copy()
    sunk[:, 2] -= sinking(roots, np.stack([paths[side].ankle for side in SIDES], 1), _REACH * figure.leg, fps)
    return Wish(
        scale=scale,
        hands=np.stack([_hand(body, figure, hips, side) for side in SIDES], axis=1),
        feet=np.stack([ankles[side] for side in SIDES], axis=1),
        qpos=_assemble(body, figure, sunk, uppers, paths),
        unplanted=_assemble(body, figure, hips, uppers, loose),
        paths=paths,
    )


def _hand(body: Anatomy, figure: Figure, hips: Floats, side: str) -> Floats:
    """Where the wrist is [F, 3] [m] when the character's bones point as the body's do."""
    arm, limb = figure.limbs[f"{side}_arm"], body.limbs[f"{side}_arm"]
    waist = hips + body.pelvis.apply(figure.character.model.body("torso").pos)
    return waist + body.torso.apply(arm.root) + arm.upper * limb.upper + arm.lower * limb.lower


def _assemble(
    body: Anatomy, figure: Figure, hips: Floats, uppers: dict[str, Rotation], feet: dict[str, FootPath]
) -> Floats:
    """Poses [F, nq] with the hips and feet there, and every other part turned as the body's."""
    qpos = np.tile(figure.character.model.qpos0, (len(hips), 1))
    qpos[:, :3] = hips
    qpos[:, 3:7] = body.pelvis.as_quat(scalar_first=True)
    qpos[:, figure.joints["abdomen"].qpos] = relative(body.pelvis, body.torso)
    qpos[:, figure.joints["neck"].qpos] = relative(body.torso, body.head)
    for name in LIMBS:
        bones, limb, upper = figure.limbs[name], body.limbs[name], uppers[name]
        side, kind = name.split("_")
        if kind == "arm":
            angle, _ = _hinge_turn(upper, limb, bones)
        else:
            root = hips + body.pelvis.apply(bones.root)
            upper, angle = _reach(feet[side].ankle - root, upper, bones)
            shin = upper * _about_y(angle)
            qpos[:, figure.joints[f"{side}_ankle"].qpos] = relative(shin, feet[side].rotation)
        qpos[:, bones.ball.qpos] = relative(limb.trunk, upper)
        qpos[:, bones.hinge.qpos.start] = angle
    return qpos


def _hinge_turn(upper: Rotation, limb: Limb, bones: LimbFigure) -> tuple[Floats, Rotation]:
    """Angle [F] [rad] of the elbow or knee that points the lower bone as the limb does, and the turn about it."""
    lower = upper.inv().apply(limb.lower)
    angle = bones.bend * np.arctan2(-bones.bend * lower[:, 0], -lower[:, 2])
    return angle, _about_y(angle)


def _reach(way: Floats, upper: Rotation, bones: LimbFigure) -> tuple[Rotation, Floats]:
    """Rotations of the thigh and angles [F] of the knee that bring the ankle to `way` [F, 3] from the hip [m].

    The plane of the leg stays as near as may be to the one that `upper` shows.
    """
    a, b = bones.upper, bones.lower
    distance = np.clip(np.linalg.norm(way, axis=1), abs(a - b) + 1e-6, a + b - 1e-9)
    bend = np.pi - np.arccos(np.clip((a * a + b * b - distance**2) / (2.0 * a * b), -1.0, 1.0))
    swing = np.arccos(np.clip((a * a + distance**2 - b * b) / (2.0 * a * distance), -1.0, 1.0))
    frame = basis_zy(-unit(way), upper.apply([0.0, 1.0, 0.0]))
    return frame * _about_y(-bones.bend * swing), bones.bend * bend


def _about_y(angle: Floats) -> Rotation:
    return Rotation.from_rotvec(angle[:, None] * np.array([0.0, 1.0, 0.0]))
