"""What a motion file holds before it is anybody's clip: a skeleton and its rotations, in SI units with z up."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

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
