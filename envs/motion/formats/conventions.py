"""From a file's own axes, unit and habits to SI units with z up; what had to be found out is reported."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.options import UNITS, ReadOptions, is_rate, metres_in
from murmillo.envs.motion.formats.quaternions import IDENTITY, about_axis, conjugate, multiply, rotate, turned_angle
from murmillo.envs.motion.formats.raw_motion import RawMotion, checked
from murmillo.envs.motion.formats.recording import Recording, global_pose
from murmillo.envs.motion.formats.roles import Roles, chain_to_root, find_roles

_Floats = NDArray[np.float64]

_PERSON = (0.8, 2.4)
"""[m] Along the bones from ankle to head joint, from a child to a giant."""
_TYPICAL_PERSON = 1.4
_JUMP = 0.15
"""[rad] Mean turn of all joints between two frames that is no motion; a fast run at 30 Hz stays below."""
_USUAL_FPS = (10.0, 480.0)
_START = 500
"""Frames in which a rest pose is looked for, and what follows it."""
_SAMPLES = 200
"""Frames that measurements look at."""


def settle(raw: RawMotion, file: Path, options: ReadOptions) -> Recording:
    """The recording in metres, z up; its findings say what was measured, told or taken from the format.

    Raises:
        MotionError: numbers that no motion has, or a size that fits no unit.
    """
    raw = checked(raw, str(file))
    findings = dict(raw.findings)
    fps = _settle_fps(raw, file, options, findings)
    roles = find_roles(raw.skeleton)
    raw = _turn_up(raw, roles, options, findings)
    raw = _scale(raw, roles, file, options, findings)
    raw = _drop_rest(raw, file, options, findings)
    raw = _mirror(raw, roles, options, findings)
    return Recording(
        name=clip_name(file),
        fps=fps,
        skeleton=raw.skeleton,
        root_pos_w=raw.root_pos,
        quat=raw.quat,
        findings=findings,
        loop=raw.loop,
    )


def clip_name(file: Path) -> str:
    """The file's stem, with _ for what cannot be printed."""
    return "".join(char if char.isprintable() else "_" for char in file.stem) or "_"


def _settle_fps(raw: RawMotion, file: Path, options: ReadOptions, findings: dict[str, str]) -> float:
    if options.fps is not None:
        findings["fps"] = f"{options.fps:g} (told)"
        return options.fps
    fps = raw.fps
    if not is_rate(fps):
        raise MotionError(f"{file}: fps is {fps:g}; tell the recording's with fps= (--fps)")
    low, high = _USUAL_FPS
    how = "format" if low <= fps <= high else "format, but unusual; if it is wrong, tell it with fps= (--fps)"
    findings["fps"] = f"{fps:.5g} ({'assumed' if raw.fps_assumed else how})"
    return fps


def _turn_up(raw: RawMotion, roles: Roles | None, options: ReadOptions, findings: dict[str, str]) -> RawMotion:
    if options.up is not None:
        up, how = options.up, "told"
    elif raw.up is not None:
        up, how = raw.up, "format"
    else:
        up, how = _measure_up(raw, roles)
    findings["up"] = f"{up} ({how})"
    return raw if up == "z" else _rotated(raw, about_axis(0, np.pi / 2.0))


def _rotated(raw: RawMotion, turn: _Floats) -> RawMotion:
    """The motion in axes turned by this rotation, joints' own axes included, so that an upright rest pose stays so."""
    return replace(
        raw,
        skeleton=replace(raw.skeleton, offsets=rotate(turn, raw.skeleton.offsets)),
        root_pos=rotate(turn, raw.root_pos),
        quat=multiply(multiply(turn, raw.quat), conjugate(turn)),
    )


def _measure_up(raw: RawMotion, roles: Roles | None) -> tuple[str, str]:
    """The axis along which the head is above the feet, at rest or else in the frames where it is most so.

    At rest first, for who crawls has the head ahead of the feet; but some skeletons rest in no human pose.
    """
    if roles is None:
        return "y", "assumed"
    rest = global_pose(raw.skeleton, np.zeros((1, 3)), np.tile(IDENTITY, (1, raw.quat.shape[1], 1)))[0]
    for pos in (rest, _sampled_positions(raw)):
        upright = pos[:, roles.head] - 0.5 * (pos[:, roles.left.foot] + pos[:, roles.right.foot])
        _, y, z = np.percentile(upright, 90.0, axis=0)
        if max(y, z) > 0.8 * np.percentile(np.linalg.norm(upright, axis=1), 90.0):
            return ("y" if y > z else "z"), "measured"
    return "y", "assumed"


def _sampled_positions(raw: RawMotion) -> _Floats:
    step = max(1, len(raw.quat) // _SAMPLES)
    return global_pose(raw.skeleton, raw.root_pos[::step], raw.quat[::step])[0]


def _scale(
    raw: RawMotion, roles: Roles | None, file: Path, options: ReadOptions, findings: dict[str, str]
) -> RawMotion:
    height = _height(raw, roles)
    if options.unit is not None:
        metres, how = metres_in(options.unit), "told"
    elif raw.unit is not None and _is_person(height * raw.unit):
        metres, how = raw.unit, "format"
    else:
        fitting = [unit for unit in UNITS.values() if _is_person(height * unit)]
        if not fitting:
            raise MotionError(
                f"{file}: its figure is {height:.3g} units tall, which fits no unit for a person; give unit= (--unit)"
            )
        metres = min(fitting, key=lambda unit: abs(math.log(height * unit / _TYPICAL_PERSON)))
        how = "measured"
    name = next((name for name, known in UNITS.items() if math.isclose(known, metres)), f"{metres:g} m")
    findings["unit"] = f"{name} ({how})"
    findings["height"] = f"{height * metres:.2f} m"
    strayed = {joint: metres * drift for joint, drift in raw.drift.items() if metres * drift > 1e-3}
    if strayed:
        worst = max(strayed, key=lambda joint: strayed[joint])
        findings["stretching bones"] = f"{len(strayed)}, {worst} by {100.0 * strayed[worst]:.1f} cm; means taken"
    return replace(
        raw,
        skeleton=replace(raw.skeleton, offsets=metres * raw.skeleton.offsets),
        root_pos=metres * raw.root_pos,
    )


def _is_person(height: float) -> bool:
    return _PERSON[0] <= height <= _PERSON[1]


def _height(raw: RawMotion, roles: Roles | None) -> float:
    """Along the bones from ankle to head, whatever the pose; without names, how far up the figure extends."""
    if roles is None:
        heights = _sampled_positions(raw)[..., 2]
        return float(np.percentile(np.ptp(heights, axis=1), 90.0))
    lengths = np.linalg.norm(raw.skeleton.offsets, axis=1)
    return float(sum(lengths[chain_to_root(raw.skeleton, joint)].sum() for joint in (roles.head, roles.left.foot)))


def _drop_rest(raw: RawMotion, file: Path, options: ReadOptions, findings: dict[str, str]) -> RawMotion:
    rest = _rest_frames(raw.quat)
    if options.drop_rest is not None:
        rest = max(1, rest) if options.drop_rest else 0
    if rest == 0:
        findings["rest frame"] = "none" if options.drop_rest is None else "kept (told)"
        return raw
    if len(raw.quat) - rest < 2:
        raise MotionError(
            f"{file}: has fewer than 2 frames after its rest pose; keep it: drop_rest=False (--keep-rest)"
        )
    findings["rest frame"] = f"{rest} left out" + ("" if options.drop_rest is None else " (told)")
    return replace(raw, quat=raw.quat[rest:], root_pos=raw.root_pos[rest:])


def _rest_frames(quat: _Floats) -> int:
    """How many frames are one pose held at the start, which the rest of the motion jumps away from."""
    if len(quat) < 4:
        return 0
    quat = quat[:_START]
    turn = turned_angle(quat[:-1], quat[1:])
    moving = turn.max(axis=0) > 1e-3  # fingers that nobody recorded would make any jump a small one
    if not moving.any():
        return 0
    turn = turn[:, moving].mean(axis=1)
    held = int((turn > 1e-6).argmax())
    following = turn[held + 1 :]
    if len(following) < 2 or turn[held] < _JUMP or turn[held] < 4.0 * np.percentile(following, 99.0):
        return 0
    return held + 1


def _mirror(raw: RawMotion, roles: Roles | None, options: ReadOptions, findings: dict[str, str]) -> RawMotion:
    if options.mirror is not None:
        mirror = options.mirror
        findings["left, right"] = "exchanged (told)" if mirror else "as named (told)"
    else:
        swapped = _is_swapped(_sampled_positions(raw), roles) if roles is not None else None
        mirror = swapped is True
        known = {True: "were exchanged, mirrored", False: "as named (measured)", None: "as named (assumed)"}
        findings["left, right"] = known[swapped]
    if not mirror:
        return raw
    reflect = np.array([1.0, -1.0, 1.0])
    return replace(
        raw,
        skeleton=replace(raw.skeleton, offsets=reflect * raw.skeleton.offsets),
        root_pos=reflect * raw.root_pos,
        quat=np.array([1.0, -1.0, 1.0, -1.0]) * raw.quat,
    )


def _is_swapped(pos: _Floats, roles: Roles) -> bool | None:
    """Whether toes and knees point backwards, as seen by one whose left and right are as named; None: cannot tell."""
    hips = 0.5 * (pos[:, roles.left.hip] + pos[:, roles.right.hip])
    ahead = np.cross(pos[:, roles.left.hip] - pos[:, roles.right.hip], pos[:, roles.head] - hips)
    legs = (roles.left, roles.right)
    evidence = [_alignment([pos[:, leg.knee] - 0.5 * (pos[:, leg.hip] + pos[:, leg.foot]) for leg in legs], ahead)]
    toes = [pos[:, leg.toe] - pos[:, leg.foot] for leg in legs if leg.toe is not None]
    if toes:
        evidence.append(_alignment(toes, ahead))
    if all(value > 0.0 for value in evidence):
        return False
    return True if all(value < -0.1 for value in evidence) else None


def _alignment(vectors: list[_Floats], ahead: _Floats) -> float:
    """Cosine between ahead and the vectors, each weighted by its length: a straight knee says little."""
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    along = sum(float(np.sum(vector * ahead)) for vector in vectors)
    return along / max(sum(float(np.linalg.norm(vector, axis=1).sum()) for vector in vectors), 1e-9)
