"""What retargeting needs to know of a character, read from its model: lengths, hinges, soles, limits."""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from murmillo.envs.character import Character
from murmillo.envs.kinematics import Joint
from murmillo.envs.motion.retarget.bases import Floats
from murmillo.envs.motion.retarget.skeleton_map import SIDES

MADE_UP = ("sword", "shield")
"""Bodies that no recording of a human has."""


@dataclass(frozen=True)
class LimbFigure:
    """An arm or leg: the part that it hangs on and where [3] [m], its bones' lengths [m], the joints at its two ends,
    its hinge, and the sign of the hinge's bend."""

    trunk: str
    root: Floats
    upper: float
    lower: float
    ball: Joint
    hinge: Joint
    bend: float


@dataclass(frozen=True)
class Sole:
    """Corners [4, 3] of a foot's sole, and the middle [3] of its front and rear edge, in the foot's frame [m]."""

    corners: Floats
    toe: Floats
    heel: Floats


class Figure:
    """A character's measures.

    Attributes:
        character: whose they are.
        limbs: by the names in `anatomy.LIMBS`.
        soles: by side.
        leg: length of thigh and shin [m].
        waist: where the trunk bends, as a share of the way from the hips to the shoulders.
        low, high: [A] bounds of the joint coordinates [rad].
        masked: key bodies that no recording of a human has.
    """

    def __init__(self, character: Character) -> None:
        self.character = character
        model = character.model
        self.joints = {joint.name: joint for joint in character.joints}
        self.limbs = {f"{side}_arm": self._limb(side, "shoulder", "elbow", "lower_arm", "hand") for side in SIDES}
        self.limbs |= {f"{side}_leg": self._limb(side, "hip", "knee", "shin", "foot") for side in SIDES}
        self.soles = {side: _sole(character, f"{side}_foot") for side in SIDES}
        self.leg = self.limbs["left_leg"].upper + self.limbs["left_leg"].lower
        waist = float(np.linalg.norm(model.body("torso").pos))
        shoulder = float(model.body("left_upper_arm").pos[2])
        self.waist = waist / (waist + shoulder)
        self.low, self.high = character.joint_limits.numpy().T
        self.masked = tuple(body for body in character.key_bodies if body in MADE_UP)

    def _limb(self, side: str, ball: str, hinge: str, lower: str, end: str) -> LimbFigure:
        model = self.character.model
        joint = model.joint(f"{side}_{hinge}")
        root = model.body(int(model.joint(f"{side}_{ball}").bodyid[0]))
        return LimbFigure(
            trunk=model.body(int(root.parentid[0])).name,
            root=root.pos.copy(),
            upper=float(np.linalg.norm(model.body(f"{side}_{lower}").pos)),
            lower=float(np.linalg.norm(model.body(f"{side}_{end}").pos)),
            ball=self.joints[f"{side}_{ball}"],
            hinge=self.joints[f"{side}_{hinge}"],
            bend=float(np.sign(joint.range.sum())),
        )

    def forward_kinematics(self, qpos: Floats) -> tuple[Floats, Floats]:
        """Positions [F, B, 3] [m] and rotations [F, B, 4] of the bodies in the poses [F, nq]."""
        pos, quat = self.character.forward_kinematics(torch.from_numpy(qpos))
        return pos.numpy(), quat.numpy()

    def body(self, name: str) -> int:
        """Position of the body in `character.bodies`."""
        return self.character.bodies.index(name)

    def coordinates(self, qpos: Floats) -> Floats:
        """Joint coordinates [F, A] [rad]; of the two rotation vectors of a ball joint the one nearer to its bounds."""
        values = self.character.joint_coordinates(torch.from_numpy(qpos)).numpy()
        for joint in self.character.joints:
            if joint.kind == "ball":
                values[..., joint.action] = nearer(values[..., joint.action], *self.bounds(joint))
        return values

    def bounds(self, joint: Joint) -> tuple[Floats, Floats]:
        return self.low[joint.action], self.high[joint.action]

    def clamped(self, qpos: Floats) -> Floats:
        """The poses [F, nq] with every joint coordinate inside its bounds."""
        return self.posed(np.clip(self.coordinates(qpos), self.low, self.high), qpos)

    def posed(self, coordinates: Floats, qpos: Floats) -> Floats:
        """The poses [F, nq] with joint coordinates [F, A] [rad] in place of their own."""
        parts = (coordinates, qpos[..., :3], qpos[..., 3:7])
        return self.character.pose(*(torch.from_numpy(np.ascontiguousarray(part)) for part in parts)).numpy()

    def excess(self, qpos: Floats) -> Floats:
        """How far the joint coordinates of the poses [F, nq] lie outside their bounds, the worst of each [F] [rad]."""
        values = self.coordinates(qpos)
        return np.maximum(0.0, np.maximum(self.low - values, values - self.high)).max(axis=-1)


def nearer(rotvec: Floats, low: Floats, high: Floats) -> Floats:
    """Of the two rotation vectors [..., 3] of one rotation, with angles a and 2 pi - a, the one nearer to its box.

    An arm that passes behind the vertical would otherwise leap from one end of its box towards the other.
    """
    angle = np.linalg.norm(rotvec, axis=-1, keepdims=True)
    other = rotvec * (1.0 - 2.0 * np.pi / np.maximum(angle, 1e-9))

    def outside(v: Floats) -> Floats:
        return np.linalg.norm(np.maximum(0.0, np.maximum(low - v, v - high)), axis=-1, keepdims=True)

    return np.where(outside(other) < outside(rotvec), other, rotvec)


def relative(parent: Rotation, child: Rotation) -> Floats:
    """Quaternions [F, 4] wxyz of the child's rotations in the parent's frame."""
    return (parent.inv() * child).as_quat(scalar_first=True)


def _sole(character: Character, body: str) -> Sole:
    model = character.model
    geom = model.geom(body)
    half = geom.size
    corners = np.array([[x, y, -1.0] for x in (1.0, -1.0) for y in (1.0, -1.0)]) * half + geom.pos
    return Sole(corners, corners[:2].mean(axis=0), corners[2:].mean(axis=0))
