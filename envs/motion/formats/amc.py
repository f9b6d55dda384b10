"""Reader of Acclaim motions (.amc), with the skeleton (.asf) beside them.

A bone turns by C M C^-1 in the frame of its parent, where C are its axes at rest and M is the product of its angles;
all frames are then aligned with the world at rest. Format: see `asf`.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.asf import ROOT, AcclaimSkeleton, Bone, euler, find_asf, read_asf
from murmillo.envs.motion.formats.conventions import settle
from murmillo.envs.motion.formats.options import ReadOptions
from murmillo.envs.motion.formats.quaternions import IDENTITY, conjugate, multiply
from murmillo.envs.motion.formats.raw_motion import RawMotion, check_size
from murmillo.envs.motion.formats.recording import Recording, Skeleton
from murmillo.envs.motion.formats.table import read_table
from murmillo.envs.motion.reading import read_bytes

_Floats = NDArray[np.float64]
_Values = dict[str, _Floats]

_MAX_BONES = 2000
_FPS = 120.0
"""[Hz] The files do not say; it is the rate of CMU's, where nearly all of them are from."""


def read_amc(data: bytes, file: Path, options: ReadOptions) -> Recording:
    """The recording in the bytes of an .amc file, with the skeleton that `find_asf` finds beside `file`.

    A joint has the name of the bone that it turns; the ends of the last bones are joints named NAME_end.

    Raises:
        MotionError: no skeleton beside it, bones that the skeleton has not, or numbers that no motion has.
    """
    asf = find_asf(file)
    skeleton = read_asf(read_bytes(asf), asf)
    joints, tips = _joints(skeleton)
    lines, in_radians = _split(data, file)
    height = next((i for i, line in enumerate(lines[1:_MAX_BONES], 1) if line.strip().isdigit()), len(lines))
    if len(lines) % height:
        raise MotionError(f"{file}: ends within a frame; the file is cut short, copy it anew")
    check_size(len(lines) // height, len(joints.names), str(file))
    values = _read_values(lines, height, skeleton, asf, file)
    scale = 1.0 if in_radians else np.pi / 180.0
    quat = np.stack([_rotation(bone, skeleton, values, scale) for bone in skeleton.bones], axis=1)
    root_pos = skeleton.root_pos + np.stack(
        [_column(skeleton.bones[0], dof, values, len(quat)) for dof in ("tx", "ty", "tz")], axis=1
    )
    findings = {"skeleton": asf.name}
    stretched = [bone.name for bone in skeleton.bones[1:] if not set(bone.dof) <= {"rx", "ry", "rz"}]
    if stretched:
        findings["stretching bones"] = f"{', '.join(stretched)[:80]}; kept at rest"
    quat = np.concatenate([quat, np.tile(IDENTITY, (len(quat), tips, 1))], axis=1)
    raw = RawMotion(joints, root_pos, quat, _FPS, up="y", unit=skeleton.unit, findings=findings, fps_assumed=True)
    return settle(raw, file, options)


def _split(data: bytes, file: Path) -> tuple[list[bytes], bool]:
    """The lines from the first frame on, and whether their angles are radians.

    A frame is a line with its number and a line for each bone that moves, the same bones in the same order.
    """
    check_size(data.count(b"\n"), 1, str(file))
    lines = [line for line in data.split(b"\n") if line and not line.isspace()]
    start = next((i for i, line in enumerate(lines) if not line.lstrip().startswith((b"#", b":"))), len(lines))
    if start == len(lines) or not lines[start].strip().isdigit():
        raise MotionError(f"{file}: has no numbered frames and so is no Acclaim motion; get the file anew")
    return lines[start:], any(line.strip().upper() == b":RADIANS" for line in lines[:start])


def _read_values(lines: list[bytes], height: int, skeleton: AcclaimSkeleton, asf: Path, file: Path) -> _Values:
    """The numbers [F, dof] of each bone that is listed, from frames of `height` lines each."""
    for frame, line in enumerate(lines[::height]):
        if not line.strip().isdigit():
            raise MotionError(f"{file}: frame {frame} has lines too many or too few; get the file anew")
    known = {bone.name: bone for bone in skeleton.bones}
    values: _Values = {}
    for row in range(1, height):
        name = lines[row].split(maxsplit=1)[0]
        bone = known.get(name.decode("utf-8", errors="replace"))
        if bone is None or bone.name in values:
            raise MotionError(f"{file}: {name[:40].decode('latin-1')!a} is not a bone of {asf.name}, or comes twice")
        values[bone.name] = _bone_values(lines[row::height], name, bone, file)
    needed = (bone.name for bone in skeleton.bones if bone.dof or bone.name == ROOT)
    missing = next((name for name in needed if name not in values), None)
    if missing is not None:
        raise MotionError(f"{file}: says nothing of {missing}, which {asf.name} lets move; give the right skeleton")
    return values


def _bone_values(lines: list[bytes], name: bytes, bone: Bone, file: Path) -> _Floats:
    rows = []
    for frame, line in enumerate(lines):
        first, *rest = line.split(maxsplit=1)
        if first != name:
            raise MotionError(f"{file}: frame {frame} lacks {bone.name} in its place; get the file anew")
        rows += rest or [b""]
    return read_table(rows, len(bone.dof), f"{bone.name} in frame", str(file))


def _rotation(bone: Bone, skeleton: AcclaimSkeleton, values: _Values, scale: float) -> _Floats:
    """[F, 4] in the frame of the parent."""
    frames = len(values[ROOT])
    order = [f"r{axis}" for axis in skeleton.turn_order] if bone.name == ROOT else bone.dof
    turns = [(dof[1], scale * _column(bone, dof, values, frames)) for dof in order if dof.startswith("r")]
    motion = np.broadcast_to(euler(turns), (frames, 4))
    if bone.name == ROOT:
        return multiply(motion, bone.axes)
    return multiply(multiply(bone.axes, motion), conjugate(bone.axes))


def _column(bone: Bone, dof: str, values: _Values, frames: int) -> _Floats:
    return values[bone.name][:, bone.dof.index(dof)] if dof in bone.dof else np.zeros(frames)


def _joints(skeleton: AcclaimSkeleton) -> tuple[Skeleton, int]:
    """A joint where each bone begins, and one at the end of each that carries no other; the count of these."""
    bones = skeleton.bones
    parents = {bone.parent for bone in bones}
    tips = [i for i in range(1, len(bones)) if i not in parents]
    begins = [np.zeros(3)] + [bones[bone.parent].span for bone in bones[1:]]
    return Skeleton(
        names=(*(bone.name for bone in bones), *(f"{bones[i].name}_end" for i in tips)),
        parents=(*(bone.parent for bone in bones), *tips),
        offsets=np.array(begins + [bones[i].span for i in tips]),
    ), len(tips)
