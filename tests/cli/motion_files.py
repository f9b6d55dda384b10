"""Small motion files to import, written as text."""

import math
from typing import Any

import numpy as np

# name, parent, offset [cm]; a T-pose with y up, facing z, of somebody 1.7 m tall
_JOINTS = (
    ("Hips", None, (0, 0, 0)),
    ("Spine", "Hips", (0, 10, 0)),
    ("Spine1", "Spine", (0, 12, 0)),
    ("Spine2", "Spine1", (0, 12, 0)),
    ("Neck", "Spine2", (0, 16, 0)),
    ("Head", "Neck", (0, 9, 0)),
    ("LeftShoulder", "Spine2", (3, 12, 0)),
    ("LeftArm", "LeftShoulder", (13, 0, 0)),
    ("LeftForeArm", "LeftArm", (27, 0, 0)),
    ("LeftHand", "LeftForeArm", (25, 0, 0)),
    ("RightShoulder", "Spine2", (-3, 12, 0)),
    ("RightArm", "RightShoulder", (-13, 0, 0)),
    ("RightForeArm", "RightArm", (-27, 0, 0)),
    ("RightHand", "RightForeArm", (-25, 0, 0)),
    ("LeftUpLeg", "Hips", (9, -4, 0)),
    ("LeftLeg", "LeftUpLeg", (0, -41, 0)),
    ("LeftFoot", "LeftLeg", (0, -41, 0)),
    ("LeftToeBase", "LeftFoot", (0, -6, 13)),
    ("RightUpLeg", "Hips", (-9, -4, 0)),
    ("RightLeg", "RightUpLeg", (0, -41, 0)),
    ("RightFoot", "RightLeg", (0, -41, 0)),
    ("RightToeBase", "RightFoot", (0, -6, 13)),
)
_ROTATIONS = "Zrotation Xrotation Yrotation"


def bvh(frames: int = 24, frame_time: str = "0.0333333", rename: dict[str, str] | None = None) -> str:
    """A BVH of Mixamo's joint names: somebody who stands, arms down, and bends the knees once; others by `rename`."""
    lines = ["HIERARCHY", *_hierarchy("Hips", 0, rename or {}), "MOTION", f"Frames: {frames}"]
    lines.append(f"Frame Time: {frame_time}")
    for frame in range(frames):
        bend = 20.0 * (1.0 - math.cos(2.0 * math.pi * frame / max(frames - 1, 1)))
        drop = 82.0 * (1.0 - math.cos(math.radians(bend)))
        values = [0.0, 93.0 - drop, 0.0]
        for name, *_ in _JOINTS:
            values += _rotation(name, bend)
        lines.append(" ".join(f"{value:.4f}" for value in values))
    return "\n".join(lines) + "\n"


def _rotation(name: str, bend: float) -> tuple[float, float, float]:
    """Degrees about z, x, y."""
    if name in ("LeftArm", "RightArm"):
        return (-80.0 if name == "LeftArm" else 80.0, 0.0, 0.0)
    about_x = {"UpLeg": -bend, "Leg": 2.0 * bend, "Foot": -bend}
    joint = name.removeprefix("Left").removeprefix("Right")
    return (0.0, about_x.get(joint, 0.0), 0.0)


def _hierarchy(name: str, depth: int, rename: dict[str, str]) -> list[str]:
    (offset,) = (offset for joint, _, offset in _JOINTS if joint == name)
    children = [joint for joint, parent, _ in _JOINTS if parent == name]
    pad = "  " * depth
    channels = f"6 Xposition Yposition Zposition {_ROTATIONS}" if depth == 0 else f"3 {_ROTATIONS}"
    lines = [f"{pad}{'JOINT' if depth else 'ROOT'} {rename.get(name, name)}", f"{pad}{{"]
    lines += [f"{pad}  OFFSET {' '.join(map(str, offset))}", f"{pad}  CHANNELS {channels}"]
    for child in children:
        lines += _hierarchy(child, depth + 1, rename)
    if not children:
        lines += [f"{pad}  End Site", f"{pad}  {{", f"{pad}    OFFSET 0 5 0", f"{pad}  }}"]
    return [*lines, f"{pad}}}"]


def amass(frames: int = 24, **changes: np.ndarray) -> dict[str, Any]:
    """The arrays of an AMASS .npz: somebody who stands in SMPL's rest pose with lowered arms."""
    poses = np.zeros((frames, 156))
    poses[:, 0] = np.pi / 2  # SMPL's y is up, AMASS's z
    poses[:, 3 * 16 + 2], poses[:, 3 * 17 + 2] = -1.3, 1.3
    poses[:, 3 * 12 + 1] = np.linspace(0.0, 0.5, frames)
    arrays = {
        "poses": poses,
        "trans": np.tile([0.0, 0.0, 0.95], (frames, 1)),
        "betas": np.zeros(16),
        "mocap_framerate": np.array(30.0),
        "gender": np.array("neutral"),
    }
    return arrays | changes
