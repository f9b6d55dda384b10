"""Changes to clips: cutting, another rate, left for right."""

import math
import re
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip, check_clip
from murmillo.envs.rotations import slerp

_SIDES = {"left": "right", "right": "left", "Left": "Right", "Right": "Left", "LEFT": "RIGHT", "RIGHT": "LEFT"}
_OTHER_SIDE = re.compile(rf"(?<!up)(?<!Up)(?:{'|'.join(_SIDES)})")
"""Who stands upright stands on no side."""
_MIRROR_ROTATION = (1.0, -1.0, 1.0, -1.0)
"""Reflection in the plane y = 0 turns a rotation's axis (x, y, z) into (-x, y, -z); so for a wxyz quaternion."""


def trim(clip: Clip, start: float = 0.0, end: float | None = None) -> Clip:
    """The frames from `start` to `end` [s], both included, each taken to the nearest frame; no loop any more.

    Raises:
        MotionError: times outside the clip, or fewer than two frames between them.
    """
    end = clip.duration if end is None else end
    half = 0.5 / clip.fps
    if not (0.0 <= start < end <= clip.duration + half):  # so written, a NaN is refused too
        raise MotionError(
            f"clip {clip.name}: cannot be cut from {start:g} to {end:g} s; it lasts from 0 to {clip.duration:.3f} s"
        )
    first, last = round(start * clip.fps), min(round(end * clip.fps), clip.frames - 1)
    if last <= first:
        raise MotionError(
            f"clip {clip.name}: {start:g} to {end:g} s is less than a frame of 1/{clip.fps:g} s; cut further apart"
        )
    whole = (first, last) == (0, clip.frames - 1)
    return replace(clip, qpos=clip.qpos[first : last + 1], loop=clip.loop and whole)


def resample(clip: Clip, fps: float, character: Character) -> Clip:
    """The clip at another rate: positions and hinges interpolated linearly, rotations along the shorter arc.

    The last frame is the last of the new ones that lies within the clip. A loop keeps its last frame, so that it
    still closes, and is stretched by less than half a frame for it.

    Raises:
        MotionError: a rate that no clip can have, or one too low for two frames.
    """
    if not (math.isfinite(fps) and fps > 0.0):
        raise MotionError(f"clip {clip.name}: fps={fps:g}: needs a rate above 0")
    steps = clip.duration * fps
    count = round(steps) if clip.loop else int(steps + 1e-6)
    if count < 1:
        raise MotionError(f"clip {clip.name}: has less than two frames at {fps:g} fps; give a higher rate")
    at = np.linspace(0.0, clip.frames - 1, count + 1) if clip.loop else np.arange(count + 1) * clip.fps / fps
    return check_clip(replace(clip, qpos=poses_at(clip, at, character), fps=fps), character)


def poses_at(clip: Clip, frames: NDArray[np.floating], character: Character) -> NDArray[np.float64]:
    """Poses [n, nq] at frames [n] of the clip, which may lie between two: rotations go along the shorter arc."""
    below = np.minimum(frames.astype(np.int64), clip.frames - 2)
    part = torch.from_numpy(frames - below)
    a, b = (torch.from_numpy(clip.qpos[rows]) for rows in (below, below + 1))
    qpos = torch.lerp(a, b, part.unsqueeze(-1))
    for columns in [slice(3, 7), *(joint.qpos for joint in character.joints if joint.kind == "ball")]:
        qpos[:, columns] = slerp(a[:, columns], b[:, columns], part)
    return qpos.numpy()


def mirror(clip: Clip, character: Character) -> Clip:
    """The clip with left and right exchanged: reflected in the vertical plane through the world's x axis.

    Every joint takes the reflected rotation of its partner on the other side, those of the trunk their own. What the
    character has on one side only cannot be exchanged: a sword stays in the right hand and a shield on the left arm.
    A wrist without a partner is held straight, and key bodies without one (sword and shield) are masked, as what the
    mirrored clip shows of them is made up. "left" and "right" in name and label change places too; a name without
    either gets "_mirrored" behind it.
    """
    qpos = torch.from_numpy(clip.qpos.copy())
    qpos[:, 1] *= -1.0
    qpos[:, 3:7] *= torch.tensor(_MIRROR_ROTATION, dtype=qpos.dtype)
    before = qpos.clone()
    joints = {joint.name: joint for joint in character.joints}
    for joint in character.joints:
        partner = joints.get(other_side(joint.name))
        if partner is None:
            qpos[:, joint.qpos] = character.default_qpos[joint.qpos]
        else:
            qpos[:, joint.qpos] = _reflected(before[:, partner.qpos], partner.kind, _axis(character, partner.name))
    single = [body for body in character.key_bodies if not _OTHER_SIDE.search(body)]
    name = other_side(clip.name)
    mirrored = replace(
        clip,
        name=name if name != clip.name else f"{clip.name}_mirrored",
        label=other_side(clip.label),
        qpos=qpos.numpy(),
        masked=tuple(body for body in character.key_bodies if body in clip.masked or body in single),
    )
    return check_clip(mirrored, character)


def other_side(name: str) -> str:
    """The name with "left" and "right" exchanged; itself where it has neither."""
    return _OTHER_SIDE.sub(lambda found: _SIDES[found.group()], name)


def _reflected(values: Tensor, kind: str, axis: Tensor) -> Tensor:
    """A joint's columns of qpos after the reflection."""
    if kind == "ball":
        return values * torch.tensor(_MIRROR_ROTATION, dtype=values.dtype)
    # an angle about an axis in the plane changes its sign, one about the plane's normal keeps it
    return values * torch.sign(axis[1].abs() - 0.5)


def _axis(character: Character, joint: str) -> Tensor:
    return torch.from_numpy(character.model.joint(joint).axis.copy())
