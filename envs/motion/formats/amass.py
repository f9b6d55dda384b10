"""Reader of AMASS and SMPL motions (.npz): body rotations by joint order, on the skeleton of the mean SMPL body.

`poses` [F, 72 (SMPL), 156 (SMPL-H) or 165 (SMPL-X)], or `root_orient` [F, 3] and `pose_body` [F, 63], are rotation
vectors [rad]; `trans` [F, 3] [m], z up. Fingers and face are left out; the shape (`betas`) is not used, for it needs
the body model, which is not free. Format: Mahmood et al., "AMASS", 2019; Loper et al., "SMPL", 2015.
"""

import io
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.conventions import settle
from murmillo.envs.motion.formats.npy import read_numbers
from murmillo.envs.motion.formats.options import ReadOptions
from murmillo.envs.motion.formats.quaternions import IDENTITY, about_axis, conjugate, from_rotvec, multiply, rotate
from murmillo.envs.motion.formats.raw_motion import RawMotion, check_size
from murmillo.envs.motion.formats.recording import Recording, Skeleton
from murmillo.envs.motion.formats.table import check_numbers

_Floats = NDArray[np.float64]

_JOINTS = {
    # joint: (parent, its place in the parent's frame at rest [m]: x left, y up, z ahead)
    "pelvis": (None, (0.0, 0.0, 0.0)),
    "left_hip": ("pelvis", (0.0586, -0.0823, -0.0177)),
    "right_hip": ("pelvis", (-0.0603, -0.0905, -0.0135)),
    "spine1": ("pelvis", (0.0044, 0.1244, -0.0384)),
    "left_knee": ("left_hip", (0.0435, -0.3865, 0.0080)),
    "right_knee": ("right_hip", (-0.0433, -0.3837, -0.0048)),
    "spine2": ("spine1", (0.0045, 0.1380, 0.0268)),
    "left_ankle": ("left_knee", (-0.0148, -0.4269, -0.0374)),
    "right_ankle": ("right_knee", (0.0191, -0.4200, -0.0346)),
    "spine3": ("spine2", (-0.0023, 0.0560, 0.0029)),
    "left_foot": ("left_ankle", (0.0411, -0.0603, 0.1220)),
    "right_foot": ("right_ankle", (-0.0348, -0.0621, 0.1303)),
    "neck": ("spine3", (-0.0134, 0.2116, -0.0335)),
    "left_collar": ("spine3", (0.0717, 0.1140, -0.0189)),
    "right_collar": ("spine3", (-0.0830, 0.1125, -0.0237)),
    "head": ("neck", (0.0101, 0.0889, 0.0504)),
    "left_shoulder": ("left_collar", (0.1229, 0.0452, -0.0190)),
    "right_shoulder": ("right_collar", (-0.1132, 0.0469, -0.0085)),
    "left_elbow": ("left_shoulder", (0.2553, -0.0156, -0.0229)),
    "right_elbow": ("right_shoulder", (-0.2601, -0.0144, -0.0313)),
    "left_wrist": ("left_elbow", (0.2657, 0.0127, -0.0074)),
    "right_wrist": ("right_elbow", (-0.2691, 0.0068, -0.0060)),
    "left_hand": ("left_wrist", (0.0867, -0.0106, -0.0156)),
    "right_hand": ("right_wrist", (-0.0888, -0.0087, -0.0101)),
}
"""SMPL's joints in its order and its mean body's measures, as given by EDGE (Tseng et al. 2023), here to 0.1 mm."""
_PELVIS = np.array([-0.0022, -0.2408, 0.0286])
"""[m] Where the pelvis is when `trans` is zero: SMPL turns the body about it, but moves the origin of the model."""
_BODY = 22
"""Joints of all layouts; SMPL alone has two hands as well, the others have fingers in their place."""
_LAYOUTS = {66: 22, 72: 24, 156: 22, 165: 22}
"""Columns of `poses`, and the joints that the first of them are."""
_RATES = ("mocap_framerate", "mocap_frame_rate", "mocap_fps", "fps")
_UPRIGHT = about_axis(0, np.pi / 2.0)
"""From SMPL's axes at rest to z up, so that joints at rest stand upright."""

_MAX_ARRAY = 128 * 2**20
"""A quarter of an hour of SMPL-H at 120 Hz."""
_MAX_MEMBERS = 1000
_DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    OSError,
    LookupError,
    ValueError,
    OverflowError,
    RuntimeError,
    NotImplementedError,
)
"""What the zip reader trips over in a damaged archive, or one that is encrypted or packed in an unknown way."""


def read_amass(data: bytes, file: Path, options: ReadOptions) -> Recording:
    """The recording in the bytes of an AMASS .npz, stageii files of AMASS-X included; nothing in it is unpickled.

    Raises:
        MotionError: no such archive, arrays that do not fit each other, or more than a clip can hold.
    """
    arrays = _read_arrays(data, file)
    turns = _turns(arrays, file)
    trans = arrays.get("trans")
    if trans is None or trans.shape != (len(turns), 3):
        shape = "missing" if trans is None else f"{list(trans.shape)}"
        raise MotionError(f"{file}: trans is {shape} and not [{len(turns)}, 3]; get the file anew")
    fps = options.fps if options.fps is not None else _rate(arrays, file)
    names = tuple(_JOINTS)
    check_size(len(turns), len(names), str(file))
    quat = np.tile(IDENTITY, (len(turns), len(names), 1))
    check_numbers(turns.reshape(len(turns), 3 * turns.shape[1]), "frame", f"{file}: rotations")
    # every joint's frame is turned upright at rest, the world stays as the file has it
    moving = multiply(from_rotvec(turns), conjugate(_UPRIGHT))
    quat[:, 0] = moving[:, 0]
    quat[:, 1 : turns.shape[1]] = multiply(_UPRIGHT, moving[:, 1:])
    skeleton = Skeleton(
        names,
        tuple(-1 if parent is None else names.index(parent) for parent, _ in _JOINTS.values()),
        rotate(_UPRIGHT, np.array([offset for _, offset in _JOINTS.values()])),
    )
    raw = RawMotion(
        skeleton, trans + _PELVIS, quat, fps, up="z", unit=1.0, findings={"body": "mean of SMPL, not the file's shape"}
    )
    return settle(raw, file, options)


def _turns(arrays: dict[str, _Floats], file: Path) -> _Floats:
    """Rotation vectors [F, J, 3] of the first J joints."""
    poses = arrays.get("poses")
    if poses is not None:
        joints = _LAYOUTS.get(poses.shape[-1]) if poses.ndim == 2 else None
        if joints is None:
            known = ", ".join(map(str, _LAYOUTS))
            raise MotionError(f"{file}: poses are {list(poses.shape)}; known are frames of {known} numbers")
        return poses[:, : 3 * joints].reshape(len(poses), joints, 3)
    root, body = arrays.get("root_orient"), arrays.get("pose_body")
    if root is None or body is None:
        raise MotionError(f"{file}: has neither poses nor root_orient and pose_body; give a motion of AMASS or SMPL")
    if root.ndim != 2 or root.shape[1] != 3 or body.shape != (len(root), 3 * (_BODY - 1)):
        raise MotionError(
            f"{file}: root_orient {list(root.shape)} and pose_body {list(body.shape)} are not [F, 3] and [F, 63]"
        )
    return np.concatenate([root, body], axis=1).reshape(len(root), _BODY, 3)


def _rate(arrays: dict[str, _Floats], file: Path) -> float:
    rate = next((arrays[name] for name in _RATES if name in arrays), None)
    if rate is None or rate.size != 1:
        raise MotionError(f"{file}: {_RATES[0]} is missing; tell the recording's frames a second with fps= (--fps)")
    return float(rate.reshape(()))


def _read_arrays(data: bytes, file: Path) -> dict[str, _Floats]:
    """The arrays that are needed, each within bounds whatever the archive claims."""
    wanted = ("poses", "root_orient", "pose_body", "trans", *_RATES)
    if data.count(b"PK\x01\x02") > _MAX_MEMBERS:
        raise MotionError(f"{file}: has more than {_MAX_MEMBERS} arrays and so is no motion; get the file anew")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = set(archive.namelist())
            return {
                name: read_numbers(_unpack(archive, name, file), f"{file}: {name}")
                for name in wanted
                if f"{name}.npy" in members
            }
    except MotionError:  # which is a ValueError
        raise
    except _DAMAGED:
        raise MotionError(f"{file}: is no .npz archive, or is cut short or damaged; copy it anew") from None


def _unpack(archive: zipfile.ZipFile, name: str, file: Path) -> bytes:
    """The array's bytes."""
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > _MAX_ARRAY:
        raise MotionError(f"{file}: {name} is larger than {_MAX_ARRAY // 2**20} MB; cut the recording into clips")
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise NotImplementedError
    with archive.open(info) as stream:
        return stream.read(info.file_size)  # not all that there is, which may be more than the archive states
