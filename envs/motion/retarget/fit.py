"""How well a clip follows the recording that it was made from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.ground import ground_of
from murmillo.envs.motion.retarget.bases import Floats
from murmillo.envs.motion.retarget.feet import find_standing
from murmillo.envs.motion.retarget.figure import Figure
from murmillo.envs.motion.retarget.pose import Wish
from murmillo.envs.motion.retarget.skeleton_map import SIDES

OWN = "own"
"""Stands for a skeleton map where the recording's skeleton is the character's own."""


@dataclass(frozen=True)
class Faults:
    """Of a clip: mean slide of a standing foot [m a frame], depth below ground [m], excess over joint limits [rad]."""

    slide: float
    depth: float
    limits: float


@dataclass(frozen=True)
class Fit:
    """What a retargeting did, and how good it is.

    Attributes:
        skeleton: name of the skeleton map, or `OWN` where rotations were copied.
        scale: the character's leg by the recording's.
        frames: of the clip.
        error_mean, error_max: distance [m] of hands and feet from where the recording, in the character's size, has
            them.
        before, after: faults of the pose that copies the recording, and of the clip.
    """

    skeleton: str
    scale: float
    frames: int
    error_mean: float
    error_max: float
    before: Faults
    after: Faults


def fit_of(before: Clip, after: Clip, wish: Wish, figure: Figure, skeleton: str) -> Fit:
    """The fit of the clip `after`; `before` copies the recording without regard to limits and ground."""
    pos_w, _ = figure.forward_kinematics(after.qpos.copy())
    ends = [figure.body(f"{side}_{part}") for part in ("hand", "foot") for side in SIDES]
    errors = np.linalg.norm(pos_w[:, ends] - np.concatenate([wish.hands, wish.feet], axis=1), axis=-1)
    standing = np.stack([wish.paths[side].standing for side in SIDES], axis=1)
    return Fit(
        skeleton=skeleton,
        scale=wish.scale,
        frames=after.frames,
        error_mean=float(errors.mean()),
        error_max=float(errors.max()),
        before=find_faults(before, standing, figure),
        after=find_faults(after, standing, figure),
    )


def copied_fit(clip: Clip, figure: Figure) -> Fit:
    """The fit of a clip whose rotations were copied: no error, and the recording's own faults."""
    pos_w, quat_w = figure.forward_kinematics(clip.qpos.copy())
    feet = [(side, figure.body(f"{side}_foot")) for side in SIDES]
    turns = {side: Rotation.from_quat(quat_w[:, foot], scalar_first=True) for side, foot in feet}
    standing = [find_standing(pos_w[:, foot], turns[side], figure.soles[side], clip.fps) for side, foot in feet]
    faults = find_faults(clip, np.stack(standing, axis=1), figure)
    return Fit(OWN, 1.0, clip.frames, 0.0, 0.0, before=faults, after=faults)


def find_faults(clip: Clip, standing: NDArray[np.bool_], figure: Figure) -> Faults:
    """Faults of a clip; `standing` [F, 2]: whether the left and the right foot are to stand."""
    return Faults(
        slide=_slide(clip.qpos.copy(), standing, figure),
        depth=float(max(0.0, -ground_of(clip, figure.character).height.min())),
        limits=float(figure.excess(clip.qpos.copy()).max()),
    )


def _slide(qpos: Floats, standing: NDArray[np.bool_], figure: Figure) -> float:
    """Mean way along the ground of the lower edge, front or rear, of a foot between two frames that it stands in."""
    pos_w, quat_w = figure.forward_kinematics(qpos)
    ways = []
    for side, stands in zip(SIDES, standing.T, strict=True):
        foot = figure.body(f"{side}_foot")
        turn = Rotation.from_quat(quat_w[:, foot], scalar_first=True)
        sole = figure.soles[side]
        edges = np.stack([pos_w[:, foot] + turn.apply(edge) for edge in (sole.toe, sole.heel)], axis=1)
        lower = np.argmin(edges[1:, :, 2] + edges[:-1, :, 2], axis=1)
        way = np.linalg.norm(np.diff(edges[..., :2], axis=0), axis=-1)[np.arange(len(lower)), lower]
        ways.append(way[stands[1:] & stands[:-1]])
    along = np.concatenate(ways)
    return float(along.mean()) if len(along) else 0.0
