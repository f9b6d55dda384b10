"""What a motion file holds before it is anybody's clip: a skeleton and its rotations, in SI units with z up."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.motion.formats.quaternions import multiply, rotate

_Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints.

    Attributes:
        names: of the J joints, each once, parents before their children; the first is the root.
        parents: [J] index of each joint's parent, -1 for the root.
        offsets: [J, 3] of each joint in its parent's frame at rest [m]; the root's is zero.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: _Floats


@dataclass(frozen=True, eq=False)
class Recording:
    """The motion of one skeleton at a constant rate, z up.

    Attributes:
        name: of the clip that it will be.
        fps: frames a second [Hz].
        skeleton: whose motion it is.
        root_pos_w: [F, 3] of the root joint in the world [m].
        quat: [F, J, 4] wxyz rotation of each joint in its parent's frame; the root's is in the world.
        findings: what was found out about the file (up axis, unit, T-pose left out), by name, to be reported.
        source, licence: as far as the file or its folder says.
        redistributable: whether the licence is known to let it be passed on freely.
        loop: whether the file says that the last frame leads into the first.
        weight: sampling weight that the file's dataset gives it.
    """

    name: str
    fps: float
    skeleton: Skeleton
    root_pos_w: _Floats
    quat: _Floats
    findings: dict[str, str] = field(default_factory=dict)
    source: str = "unknown"
    licence: str = "unknown"
    redistributable: bool = False
    loop: bool = False
    weight: float = 1.0

    @property
    def frames(self) -> int:
        """Number of frames F."""
        return len(self.quat)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (self.frames - 1) / self.fps

    def global_pose(self) -> tuple[_Floats, _Floats]:
        """Position [F, J, 3] [m] and rotation [F, J, 4] wxyz of every joint in the world."""
        return global_pose(self.skeleton, self.root_pos_w, self.quat)


def global_pose(skeleton: Skeleton, root_pos_w: _Floats, quat: _Floats) -> tuple[_Floats, _Floats]:
    """Forward kinematics: position [F, J, 3] and rotation [F, J, 4] wxyz of every joint in the world.

    Args:
        root_pos_w: [F, 3], in the skeleton's unit.
        quat: [F, J, 4] in the parent's frame, the root's in the world.
    """
    pos_w = np.empty((*quat.shape[:2], 3))
    quat_w = np.empty_like(quat)
    pos_w[:, 0], quat_w[:, 0] = root_pos_w, quat[:, 0]
    for joint, parent in enumerate(skeleton.parents[1:], start=1):
        pos_w[:, joint] = pos_w[:, parent] + rotate(quat_w[:, parent], skeleton.offsets[joint])
        quat_w[:, joint] = multiply(quat_w[:, parent], quat[:, joint])
    return pos_w, quat_w
