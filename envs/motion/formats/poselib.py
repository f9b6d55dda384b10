"""Importer of poselib clips: the .npy files of ASE, CALM and C.ASE, each a pickled dictionary of local rotations.

The format, as the files released with ASE show it: quaternions are xyzw and local to the parent, slot 0 is the root's
rotation in the world; positions are metres, z up; the rate is not always a round number (29.857 to 30 Hz).
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.character import Character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip, check_clip
from murmillo.envs.motion.formats.conventions import settle
from murmillo.envs.motion.formats.npy import split_npy
from murmillo.envs.motion.formats.options import ReadOptions
from murmillo.envs.motion.formats.raw_motion import RawMotion
from murmillo.envs.motion.formats.recording import Recording, Skeleton
from murmillo.envs.motion.formats.safe_unpickle import read_pickle

_Floats = NDArray[np.float64]

_PREFIX, _SUFFIX = "RL_Avatar_", "_Motion"
_REALLUSION = ("Reallusion, ActorCore Studio Mocap Sword and Shield, as released with ASE", "Reallusion, noncommercial")
_UNKNOWN = ("unknown", "unknown")
_LIMIT = 1e6
"""No position [m] or quaternion is as large."""
_NORM_TOLERANCE = 1e-3
"""A quaternion whose norm is further from 1 is a broken file; exporters in float32 stay below 1e-6."""
_LOST_ROTATION = 0.05
"""[rad] How far a body may turn about axes that its joint does not have; the ASE clips never do (4e-16)."""


def read_poselib(data: bytes, file: Path, character: Character, weight: float = 1.0) -> Clip:
    """The clip in the bytes of a poselib .npy file; nothing in it is run.

    Args:
        file: where the bytes are from; name and label are what is left without `RL_Avatar_` and `_Motion.npy`.
        weight: sampling weight.

    Raises:
        MotionError: not such a file, damaged, of another skeleton, or asking for code to be run.
    """
    motion = _read_motion(data, file)
    order = _body_order(motion, file, character)
    rotation = _array(motion, "rotation.arr", file, (None, len(order), 4))[:, order]
    _check_norms(rotation, file, character)
    translation = _array(motion, "root_translation.arr", file, (len(rotation), 3))
    fps = motion.get("fps")
    if not isinstance(fps, (int, float)):
        raise MotionError(f"{file}: fps is missing; give the frames a second of the recording")
    name = _short(file.stem)
    source, licence = _origin(file)
    quats = dict(zip(character.bodies, np.roll(rotation, 1, axis=-1).swapaxes(0, 1), strict=True))
    clip = Clip(
        name=name,
        character=character.name,
        fps=float(fps),
        qpos=np.concatenate([translation, *_joint_columns(quats, file, character)], axis=1),
        label=name,
        source=source,
        licence=licence,
        redistributable=False,
        weight=weight,
    )
    return check_clip(clip, character)


def read_poselib_recording(data: bytes, file: Path, options: ReadOptions) -> Recording:
    """The recording in the bytes of a poselib .npy file, whatever its skeleton; nothing in it is run.

    Raises:
        MotionError: not such a file, damaged, or asking for code to be run.
    """
    motion = _read_motion(data, file)
    tree = motion.get("skeleton_tree")
    names = tree.get("node_names") if isinstance(tree, dict) else None
    if not isinstance(names, list) or not all(isinstance(name, str) and name.isprintable() for name in names):
        raise MotionError(f"{file}: skeleton_tree.node_names is missing; export it with poselib")
    if not names or len(set(names)) != len(names):
        raise MotionError(f"{file}: its skeleton has no names, or the same twice; export it anew")
    parents = _array(motion, "skeleton_tree.parent_indices.arr", file, (len(names),))
    if parents[0] != -1.0 or any(parent not in range(joint) for joint, parent in enumerate(parents[1:], start=1)):
        raise MotionError(f"{file}: a joint comes before its parent; export it anew with the root first")
    offsets = _array(motion, "skeleton_tree.local_translation.arr", file, (len(names), 3)).copy()
    offsets[0] = 0.0
    rotation = _array(motion, "rotation.arr", file, (None, len(names), 4))
    root_pos = _array(motion, "root_translation.arr", file, (len(rotation), 3))
    fps = motion.get("fps") if options.fps is None else options.fps
    if not isinstance(fps, (int, float)):
        raise MotionError(f"{file}: fps is missing; tell the recording's with fps= (--fps)")
    skeleton = Skeleton(tuple(names), tuple(int(parent) for parent in parents), offsets)
    raw = RawMotion(skeleton, root_pos, np.roll(rotation, 1, axis=-1), float(fps), up="z", unit=1.0)
    recording = settle(raw, file, options)
    source, licence = _origin(file)
    return replace(recording, name=_short(recording.name) or recording.name, source=source, licence=licence)


def _short(stem: str) -> str:
    return stem.removesuffix(_SUFFIX).removeprefix(_PREFIX)


def _origin(file: Path) -> tuple[str, str]:
    """Source and licence; the files do not say, but the prefix is that of Reallusion's clips."""
    return _REALLUSION if file.stem.startswith(_PREFIX) else _UNKNOWN


def _read_motion(data: bytes, file: Path) -> dict[str, Any]:
    descr, shape, payload = split_npy(data, str(file))
    if (descr, shape) != ("|O", ()):
        raise MotionError(f"{file}: holds an array {list(shape)} of {descr}, no poselib motion; export it with poselib")
    motion = read_pickle(payload, str(file))
    if not isinstance(motion, dict):
        raise MotionError(f"{file}: holds no dictionary and so no poselib motion; export it with poselib")
    if motion.get("is_local") is not True:
        raise MotionError(f"{file}: its rotations are not local (is_local); export local rotations")
    return motion


def _array(motion: dict[str, Any], place: str, file: Path, shape: tuple[int | None, ...]) -> _Floats:
    """The array at this place, keys joined by dots; None in `shape` stands for any size."""
    value: Any = motion
    for key in place.split("."):
        value = value.get(key) if isinstance(value, dict) else None
    if not isinstance(value, np.ndarray):
        raise MotionError(f"{file}: {place} is missing; export it with poselib")
    if value.ndim != len(shape) or any(want not in (None, size) for want, size in zip(shape, value.shape, strict=True)):
        wanted = ["frames" if size is None else size for size in shape]
        raise MotionError(f"{file}: {place} has the shape {list(value.shape)} and not {wanted}; export it anew")
    with np.errstate(invalid="ignore"):
        value = value.astype(np.float64)
    broken = ~(np.abs(value) < _LIMIT)  # so written, a NaN is broken too
    if broken.any():
        row = int(np.argwhere(broken)[0, 0])
        raise MotionError(f"{file}: {place}[{row}] has a NaN, an infinity or a number above {_LIMIT:g}; export it anew")
    return value


def _check_norms(rotation: _Floats, file: Path, character: Character) -> None:
    """Refuse rotations [F, B, 4] that are none: what a clip keeps of hinges and fixed bodies would not show it."""
    if len(rotation) == 0:
        raise MotionError(f"{file}: has no frames; export it anew")
    norm = np.linalg.norm(rotation, axis=-1)
    frame, body = np.unravel_index(np.abs(norm - 1.0).argmax(), norm.shape)
    if abs(norm[frame, body] - 1.0) > _NORM_TOLERANCE:
        raise MotionError(
            f"{file}: frame {frame}, {character.bodies[body]}: its quaternion has norm {norm[frame, body]:.3g}; "
            "export unit quaternions"
        )


def _body_order(motion: dict[str, Any], file: Path, character: Character) -> list[int]:
    """Where the file has each of the character's bodies.

    Raises:
        MotionError: other bodies, other parents, or another size.
    """
    tree = motion.get("skeleton_tree")
    names = tree.get("node_names") if isinstance(tree, dict) else None
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise MotionError(f"{file}: skeleton_tree.node_names is missing; export it with poselib")
    missing = [body for body in character.bodies if body not in names]
    foreign = [name for name in names if name not in character.bodies]
    if missing or foreign or len(set(names)) != len(names):
        raise MotionError(
            f"{file}: is a motion of another skeleton than {character.name} (lacks {', '.join(missing) or 'none'}; "
            f"has besides {', '.join(foreign)[:80] or 'none'!a}); choose clips made for it, or retarget this one"
        )
    order = [names.index(body) for body in character.bodies]
    parents = _array(motion, "skeleton_tree.parent_indices.arr", file, (len(names),))[order]
    # in the model the world is body 0, and so the root's parent; in the file it is -1
    model_parents = character.model.body_parentid[1:] - 1
    for body, parent, model_parent in zip(character.bodies, parents, model_parents, strict=True):
        if parent != (order[model_parent] if model_parent >= 0 else -1):
            raise MotionError(f"{file}: the parent of {body} is another than in {character.name}; retarget the clip")
    offsets = _array(motion, "skeleton_tree.local_translation.arr", file, (len(names), 3))[order]
    size = np.linalg.norm(offsets[1:], axis=1).sum() / np.linalg.norm(character.model.body_pos[2:], axis=1).sum()
    if not 0.5 < size < 2.0:
        raise MotionError(f"{file}: its skeleton is {size:.3g} times the size of {character.name}; scale it to metres")
    return order


def _joint_columns(quats: dict[str, _Floats], file: Path, character: Character) -> list[_Floats]:
    """The columns of qpos after the root's position, from each body's local rotation [F, 4] wxyz.

    Raises:
        MotionError: a body turns about an axis that its joint does not have.
    """
    model = character.model
    joints = {model.body(int(model.joint(joint.name).bodyid[0])).name: joint for joint in character.joints}
    columns = [quats[character.bodies[0]]]
    for body in character.bodies[1:]:
        joint, quat = joints.get(body), quats[body]
        if joint is not None and joint.kind == "ball":
            columns.append(quat)
            continue
        axis = model.joint(joint.name).axis if joint is not None else np.zeros(3)
        along = quat[:, 1:] @ axis
        lost = 2.0 * np.arcsin(np.clip(np.linalg.norm(quat[:, 1:] - along[:, None] * axis, axis=1), 0.0, 1.0))
        frame = int(lost.argmax())
        if lost[frame] > _LOST_ROTATION:
            raise MotionError(
                f"{file}: frame {frame}, {body} turns {np.degrees(lost[frame]):.0f} degrees about an axis that "
                f"{character.name} cannot turn it about; retarget the clip"
            )
        if joint is not None:
            columns.append(_hinge_angle(along, quat[:, 0])[:, None])
    return columns


def _hinge_angle(sine: _Floats, cosine: _Floats) -> _Floats:
    """Angle [F] [rad] in (-pi, pi] of a turn whose quaternion has `sine` along the axis and `cosine` as real part."""
    angle = 2.0 * np.arctan2(sine, cosine)
    return np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
