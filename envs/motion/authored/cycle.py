"""Periodic gaits: a stride told by its timing, its waves and its footprints, and repeated.

Phase 0 is the strike of the right heel. A foot in stance is planted: it rolls off the heel's edge, stands, and rolls
over the toes' edge. In swing the leg follows a table of joint angles, bent so that the foot leaves and meets the ground
where, and as fast as, the planted foot does. Legs are solved in closed form, so that a stride closes exactly.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from murmillo.envs.character import Character
from murmillo.envs.motion.authored.feet import HEEL, SOLE, TOE
from murmillo.envs.motion.authored.leg import Leg
from murmillo.envs.motion.authored.timing import bump, minimum_jerk

SIDES = {"right": -1.0, "left": 1.0}


@dataclass(frozen=True)
class Wave:
    """A value over the stride: `mean` and cosines (amplitude, harmonic, phase of the crest)."""

    mean: float = 0.0
    parts: tuple[tuple[float, int, float], ...] = ()

    def __call__(self, phase: np.ndarray) -> np.ndarray:
        """Values at phases [F] of a stride of length 1."""
        value = np.full(len(phase), self.mean)
        for amplitude, harmonic, crest in self.parts:
            value += amplitude * np.cos(2.0 * np.pi * harmonic * (phase - crest))
        return value


def wave(mean: float, *parts: tuple[float, int, float]) -> Wave:
    """A wave of these parts."""
    return Wave(mean, parts)


# Hip flexion against the vertical, knee flexion and ankle dorsiflexion in swing [deg] by the share of swing that is
# over, of a natural walk: every tenth of the stride from 60 % on (after Winter 1991, rounded).
WALK_SWING = (
    (0.00, -5.0, 38.0, -16.0),
    (0.25, 9.0, 63.0, -11.0),
    (0.50, 19.0, 53.0, -1.0),
    (0.75, 23.0, 21.0, 1.0),
    (1.00, 20.0, 4.0, 0.0),
)


@dataclass(frozen=True)
class LegCycle:
    """What one leg does in a stride; phases are shares of the stride, angles are degrees.

    Attributes:
        stance: share of the stride in which the foot is on the ground.
        ahead: ankle ahead of the pelvis when the foot lands [m].
        apart: ankle from the line of walking [m], and `outward` how far it swings out on its way [m].
        toe_out: of the foot.
        strike: toes up at the landing; negative lands on the toes. The foot is flat after `flat`.
        heel_off, push: when the heel begins to rise, and how far the foot has rolled over the toes when it leaves.
        swing: rows of (share of swing, hip flexion against the vertical, knee flexion, dorsiflexion).
        lift: additional height of the ankle at mid-swing [m].
    """

    stance: float = 0.60
    ahead: float = 0.28
    apart: float = 0.06
    outward: float = 0.0
    toe_out: float = 7.0
    strike: float = 18.0
    flat: float = 0.09
    heel_off: float = 0.32
    push: float = 52.0
    swing: tuple[tuple[float, float, float, float], ...] = WALK_SWING
    lift: float = 0.03


@dataclass(frozen=True)
class ArmCycle:
    """One arm, degrees: swing ahead, abduction and inward twist of the upper arm against the chest, elbow flexion."""

    swing: Wave = Wave(-2.0, ((22.0, 1, 0.5),))
    out: Wave = Wave(9.0)
    twist: Wave = Wave(12.0)
    elbow: Wave = Wave(28.0, ((9.0, 1, 0.5),))


@dataclass(frozen=True)
class Gait:
    """A stride and how often it is taken. Told for the right side; the left does the same `offset` of a stride later,
    mirrored, unless it is given itself (with phases from its own footfall).

    Attributes:
        frames: of a stride, at 30 a second.
        length: of a stride [m].
        straight: least knee flexion of a standing leg [deg]; the pelvis is as high as this allows, less `crouch` [m].
        rise: of the pelvis about its mean height [m]; sway: to the left [m]; surge: ahead of even progress [m].
        hips, chest, head: yaw, pitch (forward) and roll (to the right) in the walking direction [deg].
        loop: a stride leads into the next.
    """

    label: str
    frames: int
    length: float
    strides: int
    leg: LegCycle = LegCycle()
    other_leg: LegCycle | None = None
    arm: ArmCycle = ArmCycle()
    other_arm: ArmCycle | None = None
    offset: float = 0.5
    straight: float = 8.0
    crouch: float = 0.0
    rise: Wave = Wave(0.0, ((0.011, 2, 0.31),))
    sway: Wave = Wave(0.0, ((0.022, 1, 0.82),))
    surge: Wave = Wave(0.0, ((0.006, 2, 0.05),))
    hips: tuple[Wave, Wave, Wave] = (
        Wave(0.0, ((5.0, 1, 0.0),)),
        Wave(3.0, ((1.0, 2, 0.1),)),
        Wave(0.0, ((4.0, 1, 0.68),)),
    )
    chest: tuple[Wave, Wave, Wave] = (
        Wave(0.0, ((5.0, 1, 0.5),)),
        Wave(3.0, ((1.2, 2, 0.12),)),
        Wave(0.0, ((1.5, 1, 0.28),)),
    )
    head: tuple[Wave, Wave, Wave] = (Wave(0.0), Wave(2.0, ((1.0, 2, 0.35),)), Wave(0.0))
    loop: ClassVar[bool] = True


def stride(gait: Gait, character: Character) -> np.ndarray:
    """The gait as qpos [F, nq] at 30 frames a second, from a right footfall to another; the last pose is the first."""
    phase = np.arange(gait.frames * gait.strides + 1) / gait.frames
    body = _Body(gait)
    feet = {side: _Foot(gait, side, Leg(character.model, side)) for side in SIDES}
    pelvis, hips = body.pelvis(phase), body.turned(gait.hips, phase)
    pelvis[:, 2] += min(foot.highest_pelvis(body) for foot in feet.values()) - gait.crouch
    body.height = float(pelvis[0, 2] - gait.rise(phase[:1])[0])
    chest, head = body.turned(gait.chest, phase), body.turned(gait.head, phase)

    joints = {"abdomen": (hips.inv() * chest).as_rotvec(), "neck": (chest.inv() * head).as_rotvec()}
    for side, foot in feet.items():
        joints |= foot.joints(body, phase)
        arm = gait.other_arm or gait.arm if side == "left" else gait.arm
        joints |= _arm(arm, side, phase - foot.offset)
    coordinates = np.hstack([joints[joint.name] for joint in character.joints])
    wished = (coordinates, pelvis, hips.as_quat(scalar_first=True))
    return character.pose(*(torch.from_numpy(part) for part in wished)).numpy()


class _Body:
    """Where the pelvis is, and how the trunk is turned, at any phase since the first right footfall."""

    def __init__(self, gait: Gait) -> None:
        self.gait = gait
        self.height = 0.0  # of the pelvis, about which it rises and falls [m]

    def pelvis(self, phase: np.ndarray) -> np.ndarray:
        """[F, 3] [m]."""
        gait = self.gait
        ahead = gait.length * phase + gait.surge(phase)
        return np.stack([ahead, gait.sway(phase), self.height + gait.rise(phase)], axis=-1)

    @staticmethod
    def turned(waves: tuple[Wave, Wave, Wave], phase: np.ndarray) -> Rotation:
        """F rotations in the world of yaw, pitch and roll waves [deg]."""
        return turns(*(each(phase) for each in waves))

    def hip(self, leg: Leg, phase: np.ndarray) -> np.ndarray:
        """A hip joint in the world, [F, 3] [m]."""
        return self.pelvis(phase) + self.turned(self.gait.hips, phase).apply(leg.hip)


class _Foot:
    """One foot through its stride, by phases since its own first landing."""

    def __init__(self, gait: Gait, side: str, leg: Leg) -> None:
        self.side, self.leg, self._length = side, leg, gait.length
        self._straight = gait.straight
        self._cycle = gait.other_leg or gait.leg if side == "left" else gait.leg
        self.offset = gait.offset if side == "left" else 0.0
        self._swing = CubicSpline(*_columns(self._cycle.swing))

    def joints(self, body: _Body, phase: np.ndarray) -> dict[str, np.ndarray]:
        """Rotation vectors of hip and ankle [F, 3] and angle of the knee [F, 1] [rad] at phases of the body."""
        x, y, z, pitch = self._path(body, phase - self.offset).T
        yaw = np.full(len(phase), SIDES[self.side] * self._cycle.toe_out)
        hips, hip_w = body.turned(body.gait.hips, phase), body.hip(self.leg, phase)
        hip, knee, ankle = self.leg.solve(hips, hip_w, np.stack([x, y, z], axis=-1), turns(yaw, pitch), yaw)
        angles = (hip.as_rotvec(), knee[:, None], ankle.as_rotvec())
        return {f"{self.side}_{name}": value for name, value in zip(("hip", "knee", "ankle"), angles, strict=True)}

    def highest_pelvis(self, body: _Body) -> float:
        """Greatest height of the pelvis at which the leg, where it stands, keeps its least flexion [m]."""
        since = np.linspace(0.0, self._cycle.stance, 64)
        line = self._planted(since)[:, :3] - body.hip(self.leg, since + self.offset)
        across = np.linalg.norm(line[:, :2], axis=-1)
        room = np.sqrt(np.maximum(self.leg.reach(self._straight) ** 2 - across**2, 0.0))
        return float((line[:, 2] + room).min())

    def _path(self, body: _Body, phase: np.ndarray) -> np.ndarray:
        """Ankle [m] and toes-down pitch [deg] in the world, [F, 4]."""
        footprint, since = np.floor(phase + 1e-9), (phase + 1e-9) % 1.0
        stance = self._cycle.stance
        path = self._planted(since)
        swinging = since > stance
        share = (since[swinging] - stance) / (1.0 - stance)
        path[swinging] = self._swung(body, share) + self._correction(body, share)
        path[:, 0] += self._length * footprint
        return path

    def _planted(self, since: np.ndarray) -> np.ndarray:
        """The path [F, 4] of a foot that rolls on its first footprint; it may leave the ground early or late."""
        cycle = self._cycle
        roll = np.maximum((since - cycle.heel_off) / (cycle.stance - cycle.heel_off), 0.0)
        pitch = cycle.push * roll**1.7 - cycle.strike * (1.0 - minimum_jerk(since / cycle.flat))
        yaw = np.full(len(since), SIDES[self.side] * cycle.toe_out)
        flat = np.array([self._length * self.offset + cycle.ahead, SIDES[self.side] * cycle.apart, SOLE])
        edge = np.where(pitch[:, None] > 0.0, TOE, HEEL)
        return np.column_stack([flat + turns(yaw).apply(edge) - turns(yaw, pitch).apply(edge), pitch])

    def _swung(self, body: _Body, share: np.ndarray) -> np.ndarray:
        """The path [F, 4] on which the table of the swing leads the foot."""
        cycle = self._cycle
        lean, knee, dorsiflexion = self._swing(share).T
        phase = cycle.stance + share * (1.0 - cycle.stance) + self.offset
        ankle = body.hip(self.leg, phase)
        ankle[:, [0, 2]] += self.leg.hang(lean, knee)
        ankle[:, 1] = SIDES[self.side] * (cycle.apart + cycle.outward * bump(share))
        ankle[:, 2] += cycle.lift * bump(share)
        return np.column_stack([ankle, knee - lean - dorsiflexion])

    def _correction(self, body: _Body, share: np.ndarray) -> np.ndarray:
        """What makes the swing begin and end where the foot is planted, and as fast, [F, 4]."""
        stance, step = self._cycle.stance, 1e-4
        ends = np.array([0.0, 1.0])
        landed = np.array([self._length, 0.0, 0.0, 0.0])
        there = self._planted(np.array([stance, 0.0])) + np.outer(ends, landed)
        later = self._planted(np.array([stance, 0.0]) + step * (1.0 - stance)) + np.outer(ends, landed)
        swung, swung_later = self._swung(body, ends), self._swung(body, ends + step)
        gap, rate = there - swung, (later - there - swung_later + swung) / step
        s, blend = share[:, None], minimum_jerk(share)[:, None]
        offset = (1.0 - blend) * gap[0] + blend * gap[1]
        return offset + s * (1.0 - s) ** 4 * rate[0] - (1.0 - s) * s**4 * rate[1]


def turns(yaw: np.ndarray, pitch: np.ndarray | float = 0.0, roll: np.ndarray | float = 0.0) -> Rotation:
    """F rotations of yaw, pitch (forward) and roll (to the right) [F] [deg]."""
    return Rotation.from_euler("ZYX", np.stack(np.broadcast_arrays(yaw, pitch, roll), axis=-1), degrees=True)


def _arm(arm: ArmCycle, side: str, phase: np.ndarray) -> dict[str, np.ndarray]:
    """Rotation vector of the shoulder [F, 3] and angle of the elbow [F, 1] [rad]."""
    angles = np.stack([-arm.swing(phase), SIDES[side] * arm.out(phase), -SIDES[side] * arm.twist(phase)], axis=-1)
    shoulder = Rotation.from_euler("YXZ", angles, degrees=True)
    return {f"{side}_shoulder": shoulder.as_rotvec(), f"{side}_elbow": -np.radians(arm.elbow(phase))[:, None]}


def _columns(rows: tuple[tuple[float, float, float, float], ...]) -> tuple[np.ndarray, np.ndarray]:
    table = np.array(rows)
    return table[:, 0], table[:, 1:]
