"""A motion clip: the poses of one character at a fixed rate, and where they come from."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from murmillo.envs.character import Character
from murmillo.envs.errors import MotionError

_NORM_TOLERANCE = 1e-3
"""A quaternion whose norm is further from 1 is a broken file; exporters in float32 stay below 1e-6."""
_LIMIT = 1e6
"""No position [m], quaternion or angle [rad] is as large."""
_EXACT = 1e-9
"""Norms nearer to 1 are left as they are, so that checking a clip twice gives the same bits."""


@dataclass(frozen=True, eq=False)
class Clip:
    """Poses of a character at a constant rate.

    Attributes:
        name: unique among the clips of a folder.
        character: name of the character that it is for.
        fps: frames a second [Hz].
        qpos: [F, nq] float64, read-only: MuJoCo positions of the character. Root position in the world [m] and
            rotation (wxyz), then the joints in MJCF order: a quaternion (wxyz) a ball, an angle [rad] a hinge.
        label: the skill that it shows; clips may share one.
        source, licence: who made it, and what that allows.
        redistributable: whether the licence lets it, and weights trained on it, be passed on freely.
        weight: sampling weight against the other clips, > 0.
        loop: whether the last frame leads into the first.
        masked: key bodies that the source had not, such as sword and shield: what the clip shows of them is made up,
            and no discriminator should judge by it.
        origin: SHA-256 of the file that it was imported from, in hexadecimal; empty where there is none.

    Raises:
        MotionError: a rate, a frame or a weight that no clip can have.
    """

    name: str
    character: str
    fps: float
    qpos: NDArray[np.float64]
    label: str
    source: str
    licence: str
    redistributable: bool
    weight: float = 1.0
    loop: bool = False
    masked: tuple[str, ...] = ()
    origin: str = ""

    def __post_init__(self) -> None:
        if not all(text and text.isprintable() for text in (self.name, self.label)):
            raise MotionError(f"clip {self.name!a}, label {self.label!a}: give it a name and a label of printable text")
        if not (math.isfinite(self.fps) and self.fps > 0.0):
            raise MotionError(f"clip {self.name}: fps is {self.fps:g}; give the frames a second of the recording")
        if not (math.isfinite(self.weight) and self.weight > 0.0):
            raise MotionError(f"clip {self.name}: weight is {self.weight:g}; give one above 0 or leave it out")
        with np.errstate(invalid="ignore"):
            qpos = np.array(self.qpos, dtype=np.float64)
        if qpos.ndim != 2 or len(qpos) < 2:
            raise MotionError(f"clip {self.name}: frames are {list(qpos.shape)}; a clip needs [F, nq] with at least 2")
        broken = ~(np.abs(qpos) < _LIMIT).all(axis=1)  # so written, a NaN is broken too
        if broken.any():
            frame = int(broken.argmax())
            raise MotionError(
                f"clip {self.name}: frame {frame} of {len(qpos)} has a NaN, an infinity or a number above {_LIMIT:g}; "
                "cut it out or export the clip anew"
            )
        qpos.flags.writeable = False
        object.__setattr__(self, "qpos", qpos)

    @property
    def frames(self) -> int:
        """Number of frames F."""
        return len(self.qpos)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (self.frames - 1) / self.fps


def check_clip(clip: Clip, character: Character) -> Clip:
    """The clip made fit for this character: unit quaternions that never jump to their negatives between two frames.

    Checking what has been checked changes no bit.

    Raises:
        MotionError: a clip of another character or layout, a masked body that the character has not, or a frame whose
            quaternion is not a rotation.
    """
    if clip.character != character.name:
        raise MotionError(
            f"clip {clip.name}: is for the character {clip.character}, not {character.name}; choose clips made for it"
        )
    if clip.qpos.shape[1] != character.model.nq:
        raise MotionError(
            f"clip {clip.name}: frames have {clip.qpos.shape[1]} numbers, {character.name} has {character.model.nq}; "
            "export it anew for this character"
        )
    foreign = [body for body in clip.masked if body not in character.key_bodies]
    if foreign:
        raise MotionError(
            f"clip {clip.name}: masks {foreign[0]!a}, {character.name} has {', '.join(character.key_bodies)}; use one"
        )
    qpos = clip.qpos.copy()
    rotations = {"root": slice(3, 7)} | {joint.name: joint.qpos for joint in character.joints if joint.kind == "ball"}
    for name, columns in rotations.items():
        quat = qpos[:, columns]
        norm = np.linalg.norm(quat, axis=1)
        broken = np.abs(norm - 1.0) > _NORM_TOLERANCE
        if broken.any():
            frame = int(broken.argmax())
            raise MotionError(
                f"clip {clip.name}: frame {frame}, {name}: its quaternion has norm {norm[frame]:.3g}; export anew"
            )
        inexact = np.abs(norm - 1.0) > _EXACT
        quat[inexact] /= norm[inexact, None]
        flips = np.sum(quat[1:] * quat[:-1], axis=1) < 0.0
        quat[1:][np.cumsum(flips) % 2 == 1] *= -1.0
    return replace(clip, qpos=qpos)
