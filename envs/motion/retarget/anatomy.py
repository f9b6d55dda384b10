"""A recording as the motion of a human body: what its joints' own axes mean is found out, not presumed.

Frames of the body's parts have x ahead, y left and z up when the body stands upright with its arms hanging. Exporters
give joints any axes at all, so a joint's rotation only carries a frame along; what the frame is, is read from where the
joints are: in the rest pose if that is a standing one, in the motion if it is not.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.recording import Recording, global_pose
from murmillo.envs.motion.retarget.bases import Floats, basis_yz, basis_zy, smoothstep, swung, unit
from murmillo.envs.motion.retarget.skeleton_map import SIDES, ancestors

LIMBS = {
    **{f"{side}_arm": (f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist") for side in SIDES},
    **{f"{side}_leg": (f"{side}_hip", f"{side}_knee", f"{side}_ankle") for side in SIDES},
}
DOWN = np.array([0.0, 0.0, -1.0])
_STANDING = np.cos(np.radians(30.0))  # legs and trunk of a standing rest pose are as upright as this
_NO_LENGTH = 1e-3  # [m]
_AXIS_ALIGNED = np.radians(25.0)  # a joint whose axes are nearer to the body's than this is meant to be aligned to it


@dataclass(frozen=True)
class Limb:
    """An arm or a leg.

    Attributes:
        upper, lower: [F, 3] unit directions of upper arm and forearm, or thigh and shin, in the world.
        carrier: rotations [F] of the joint that moves the upper bone, in the recording's own axes.
        length: of both bones together [m].
        trunk: rotations [F] of the part that it hangs on.
    """

    upper: Floats
    lower: Floats
    carrier: Rotation
    length: float
    trunk: Rotation


@dataclass(frozen=True)
class Foot:
    """Ankle [F, 3] [m] and its joint's rotations [F]; toe joint [F, 3] [m] if there is one.

    `standing` is the foot's frame in the ankle joint's axes, if the rest pose shows it.
    """

    ankle: Floats
    carrier: Rotation
    toe: Floats | None
    standing: Rotation | None


@dataclass(frozen=True)
class Anatomy:
    """The motion of a human body: F frames, world frame, the recording's own size.

    Attributes:
        hips: [F, 3] between the hip joints [m].
        pelvis, torso, head: rotations [F] of these parts.
        limbs: by the names in `LIMBS`.
        feet: by side.
        leg: mean length of thigh and shin together [m].
    """

    hips: Floats
    pelvis: Rotation
    torso: Rotation
    head: Rotation
    limbs: dict[str, Limb]
    feet: dict[str, Foot]
    leg: float


def understand(recording: Recording, points: dict[str, int], waist: float) -> Anatomy:
    """See the body in a recording.

    Args:
        points: index of the joint at each point, from `skeleton_map.locate`.
        waist: where the character's trunk bends, as a share of the way from its hips to its shoulders.

    Raises:
        MotionError: a bone without length, or a body whose left and right joints fall together.
    """
    pos_w, quat_w = recording.global_pose()
    motion = _View(recording, points, pos_w, quat_w)
    _check_sizes(motion, recording.name)
    still = np.zeros((1, len(recording.skeleton.names), 4))
    still[..., 0] = 1.0
    rest = _View(recording, points, *global_pose(recording.skeleton, np.zeros((1, 3)), still))
    upright = _upright(rest)
    pelvis, torso = _pelvis(motion, upright), _torso(motion, waist)
    if upright is not None:
        torso = torso * (_torso(rest, waist)[0].inv() * upright)
    limbs = {name: _limb(motion, joints, torso if "arm" in name else pelvis) for name, joints in LIMBS.items()}
    return Anatomy(
        hips=motion.between("left_hip", "right_hip"),
        pelvis=pelvis,
        torso=torso,
        head=_head(motion, torso, upright),
        limbs=limbs,
        feet={
            side: Foot(
                ankle=motion.at(f"{side}_ankle"),
                carrier=motion.turn(f"{side}_ankle"),
                toe=motion.at(f"{side}_toe") if f"{side}_toe" in points else None,
                standing=upright,
            )
            for side in SIDES
        },
        leg=float(np.mean([limbs[f"{side}_leg"].length for side in SIDES])),
    )


def _check_sizes(motion: "_View", place: str) -> None:
    pairs = [pair for joints in LIMBS.values() for pair in pairwise(joints)]
    for a, b in (*pairs, ("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"), ("pelvis", "left_shoulder")):
        if np.linalg.norm(motion.at(a) - motion.at(b), axis=1).min() < _NO_LENGTH:
            raise MotionError(f"{place}: {a} and {b} are in one place; correct the skeleton map, or the file's offsets")
    trunk = motion.between("left_shoulder", "right_shoulder") - motion.between("left_hip", "right_hip")
    if np.linalg.norm(trunk, axis=1).min() < _NO_LENGTH:
        raise MotionError(f"{place}: its trunk has no length; correct the skeleton map, or the file's offsets")


class _View:
    """Joints by the names of the points, in some frames."""

    def __init__(self, recording: Recording, points: dict[str, int], pos_w: Floats, quat_w: Floats) -> None:
        self.points = points
        self._skeleton = recording.skeleton
        self._pos_w, self._quat_w = pos_w, quat_w

    def at(self, point: str) -> Floats:
        """Position of the point's joint [F, 3] [m]."""
        return self._pos_w[:, self.points[point]]

    def turn(self, point: str) -> Rotation:
        """Rotations of the point's joint [F]."""
        return Rotation.from_quat(self._quat_w[:, self.points[point]], scalar_first=True)

    def between(self, a: str, b: str) -> Floats:
        return 0.5 * (self.at(a) + self.at(b))

    def across(self, a: str, b: str, carrier: str) -> Floats:
        """Direction [F, 3] from b to a, which the joint at `carrier` carries, freed of how they move against it."""
        turn = self.turn(carrier)
        return turn.apply(turn.inv().apply(self.at(a) - self.at(b)).mean(axis=0))

    def spine(self) -> Floats:
        """Points [F, S, 3] from between the hips along the joints of the spine to between the shoulders."""
        chest = self.points["chest"]
        joints = [chest, *ancestors(self._skeleton, chest)]
        if self.points["pelvis"] in joints:
            joints = joints[: joints.index(self.points["pelvis"])]
        hips, shoulders = self.between("left_hip", "right_hip"), self.between("left_shoulder", "right_shoulder")
        return np.stack([hips, *(self._pos_w[:, joint] for joint in reversed(joints)), shoulders], axis=1)


def _upright(rest: _View) -> Rotation | None:
    """The standing body's frame in the rest pose, or None if that is not a standing pose."""
    hips, shoulders = rest.between("left_hip", "right_hip")[0], rest.between("left_shoulder", "right_shoulder")[0]
    legs = unit(np.array([rest.at(f"{side}_ankle")[0] - rest.at(f"{side}_hip")[0] for side in SIDES]))
    shins = unit(np.array([rest.at(f"{side}_ankle")[0] - rest.at(f"{side}_knee")[0] for side in SIDES]))
    up = -unit(legs.sum(axis=0))
    left = unit(rest.at("left_hip")[0] - rest.at("right_hip")[0])
    upright = min(*(-legs @ up), *(-shins @ up), unit(shoulders - hips) @ up)
    if upright < _STANDING or abs(left @ up) > 0.3:
        return None
    return basis_zy(up[None], left[None])[0]


def _pelvis(motion: _View, upright: Rotation | None) -> Rotation:
    """Left is along the hips; up is that of the rest pose, or else to where the spine leaves the pelvis."""
    carrier = motion.turn("pelvis")
    left = motion.across("left_hip", "right_hip", "pelvis")
    if upright is not None:
        return basis_yz(left, carrier.apply(upright.apply([0.0, 0.0, 1.0])))
    spine = motion.spine()
    lengths = np.linalg.norm(np.diff(spine, axis=1), axis=-1).mean(axis=0).cumsum()
    first = 1 + int(np.argmax(lengths > 0.1 * lengths[-1]))
    up = carrier.inv().apply(spine[:, first] - spine[:, 0]).mean(axis=0)
    return basis_yz(left, carrier.apply(up))


def _torso(view: _View, waist: float) -> Rotation:
    """Up runs from the waist to between the shoulders, left along the shoulders."""
    spine = view.spine()
    steps = np.linalg.norm(np.diff(spine, axis=1), axis=-1)
    lengths = np.concatenate([np.zeros((len(steps), 1)), steps.cumsum(axis=1)], axis=1)
    share = lengths / lengths[:, -1:]
    low = np.maximum(np.sum(share <= waist, axis=1) - 1, 0)
    frames = np.arange(len(spine))
    t = (waist - share[frames, low]) / np.maximum(share[frames, low + 1] - share[frames, low], 1e-9)
    bend = spine[frames, low] + t[:, None] * (spine[frames, low + 1] - spine[frames, low])
    return basis_zy(spine[:, -1] - bend, view.across("left_shoulder", "right_shoulder", "chest"))


def _head(motion: _View, torso: Rotation, upright: Rotation | None) -> Rotation:
    """As the rest pose shows it; or with the joint's axes that are nearest to the trunk's; or straight on average."""
    if "head" not in motion.points:
        return torso
    carrier = motion.turn("head")
    if upright is not None:
        return carrier * upright
    straight = (carrier.inv() * torso).mean()
    aligned = Rotation.create_group("O")
    nearest = aligned[int(np.argmin((aligned.inv() * straight).magnitude()))]
    return carrier * (nearest if (nearest.inv() * straight).magnitude() < _AXIS_ALIGNED else straight)


def _limb(motion: _View, joints: tuple[str, str, str], trunk: Rotation) -> Limb:
    upper, lower = (motion.at(end) - motion.at(start) for start, end in pairwise(joints))
    length = float(np.median(np.linalg.norm(upper, axis=1)) + np.median(np.linalg.norm(lower, axis=1)))
    return Limb(unit(upper), unit(lower), motion.turn(joints[0]), length, trunk)


def upper_frames(limb: Limb, bend: float) -> Rotation:
    """Frames of upper arm or thigh [F]: z against the bone, y along the axis that the elbow or knee turns about.

    Where the limb is bent, its plane shows the axis. Where it is straight, the bone's joint carries the axis on as it
    mostly was; and where it never bends, it is the trunk's.

    Args:
        bend: +1 if a positive turn about y bends the joint (knees), -1 if a negative one does (elbows).
    """
    along = np.sum(limb.upper * limb.lower, axis=1)
    ahead = -bend * (limb.lower - along[:, None] * limb.upper)
    sine = np.linalg.norm(ahead, axis=1)
    hanging = swung(limb.trunk, DOWN, limb.upper)
    ahead = np.where(sine[:, None] > 1e-3, ahead, hanging.apply([1.0, 0.0, 0.0]))
    shown = basis_zy(-limb.upper, np.asarray(np.cross(ahead, limb.upper), dtype=np.float64))
    candidates = Rotation.concatenate([limb.carrier.inv() * shown, limb.carrier.inv() * hanging])
    carried = limb.carrier * candidates.mean(np.concatenate([sine**2, np.full(len(sine), 1e-3)]))
    carried = swung(carried, DOWN, limb.upper)
    between = (carried.inv() * shown).as_rotvec()  # about z only
    # the plane is believed the more, the more the limb is bent; but not where it seems to bend the wrong way
    trust = smoothstep(sine, 0.1, 0.35) * smoothstep(np.cos(between[:, 2]), -0.2, 0.2)
    return carried * Rotation.from_rotvec(trust[:, None] * between)
