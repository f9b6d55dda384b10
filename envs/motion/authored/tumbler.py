"""The character on the ground: poses told by what touches where, solved by inverse kinematics (mink)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import mink
import numpy as np
from scipy.spatial.transform import Rotation

from murmillo.envs.character import Character
from murmillo.envs.motion.authored.body import (
    CHEST_TO_NECK,
    SOLVER,
    BallBox,
    Pose,
    Puppet,
    blade_rotation,
    relaxed,
    shield_rotation,
    turn,
)
from murmillo.envs.motion.authored.feet import HEEL, SOLE, TOE, Place
from murmillo.envs.motion.authored.take import Key, Take, perform
from murmillo.envs.motion.authored.touch import Clearance, Touch, place_of

SIDES = ("left", "right")
STANDING = tuple(f"{side}_{part}" for side in SIDES for part in ("heel", "toe"))
FREE_STEPS, KEY_STEPS, FRAME_STEPS = 60, 160, 8  # a key finds its shape first, then what overlaps is parted
STILL = 0.5  # length of the take from which a standing pose is drawn [s]
TURN_COSTS = {
    "torso": 2.0,
    "head": 1.0,
    "right_hand": 1.0,
    "left_lower_arm": 2.0,
    "left_foot": 4.0,
    "right_foot": 4.0,
}
Point = tuple[float, float, float]
Attitude = tuple[float, float, float]


@dataclass(frozen=True)
class Low:
    """A pose in the world frame (x ahead, y left, z up), metres and degrees.

    `hips`, `chest` and `head` are attitudes: which way the spine leans (yaw), how far (90: lying), and how far the body
    is then turned about its own spine (to the left is positive). `points` are places of bodies' origins or of the
    points in `touch.POINTS`; `soles` are the yaw and toes-down pitch of a foot. `hand`, `shield`, `blade` and `face`
    are as in `body.Pose`, along the axes of the world; what is None follows from the rest.
    """

    pelvis: Point
    hips: Attitude
    chest: Attitude
    head: Attitude
    points: Mapping[str, Point] = field(default_factory=dict)
    soles: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    hand: Point | None = None
    shield: Point | None = None
    blade: tuple[float, float, float] | None = None
    face: tuple[float, float, float] | None = None

    def but(self, **changes: Any) -> "Low":
        """This pose with some of its words changed; points and soles that are not named stay."""
        merged = {name: {**getattr(self, name), **changes.pop(name)} for name in ("points", "soles") if name in changes}
        return replace(self, **merged, **changes)

    def without(self, *names: str) -> "Low":
        """This pose with these points and soles let go."""
        return replace(
            self,
            points={name: place for name, place in self.points.items() if name not in names},
            soles={name: angles for name, angles in self.soles.items() if name not in names},
        )


@dataclass(frozen=True)
class Stand:
    """A pose on both feet as other skills have it, in the stance that is theirs, moved by `x` and `y` [m]."""

    pose: Pose
    x: float = 0.0
    y: float = 0.0


def planted(**places: Place) -> dict[str, Point]:
    """Heel and toe of each named foot, flat on the ground at its place."""
    points = {}
    for side, place in places.items():
        for part, offset in (("heel", HEEL), ("toe", TOE)):
            x, y, z = np.array([place.x, place.y, SOLE]) + turn(place.yaw).apply(offset)
            points[f"{side}_{part}"] = (float(x), float(y), float(z))
    return points


def attitude(yaw: float, lean: float, twist: float) -> Rotation:
    """Rotation whose z axis leans by `lean` towards `yaw`, then turned about itself by `twist` [deg]."""
    return Rotation.from_euler("ZYZ", [yaw, lean, twist], degrees=True)


class Tumbler:
    """Solves poses near the ground; keeps its last solution as the start of the next."""

    def __init__(self, character: Character) -> None:
        model = character.model
        self._character = character
        self._configuration = mink.Configuration(model)
        self._limits = [mink.ConfigurationLimit(model), BallBox(model)]
        self._clear = Clearance(model)
        self._touch = Touch()
        self._pelvis = mink.FrameTask("pelvis", "body", position_cost=8.0, orientation_cost=3.0)
        self._turns = {
            name: mink.FrameTask(name, "body", position_cost=0.0, orientation_cost=cost)
            for name, cost in TURN_COSTS.items()
        }
        self._posture = mink.PostureTask(model, cost=0.08)
        self._follow = mink.PostureTask(model, cost=1.0)
        self._relaxed = relaxed(model)

    def pose(self, pose: Low | Stand, start: np.ndarray | None = None) -> np.ndarray:
        """Joint angles of a key pose [nq], sought from the pose `start` [nq] or, without one, from a loose crouch."""
        if isinstance(pose, Stand):
            self._configuration.update(self._stand(pose))
            return self._configuration.q.copy()
        turns = _turns(pose)
        self._clear.set_lifts({})
        self._pelvis.set_target(_se3(np.array(pose.pelvis), attitude(*pose.hips)))
        self._posture.set_target(self._relaxed)
        start = (self._relaxed if start is None else start).copy()
        start[:3], start[3:7] = pose.pelvis, attitude(*pose.hips).as_quat(scalar_first=True)
        self._configuration.update(start)
        ground = {name: np.array(place) for name, place in pose.points.items()}
        carried = {"right_hand": pose.hand, "shield": pose.shield}
        carried = {name: np.array(place) for name, place in carried.items() if place is not None}
        for step in range(KEY_STEPS):
            torso = self._configuration.get_transform_frame_to_world("torso", "body")
            neck = torso.translation() + attitude(*pose.chest).apply([0.0, 0.0, CHEST_TO_NECK])
            self._touch.set_target(ground | {name: neck + place for name, place in carried.items()})
            self._step([self._pelvis, self._touch, self._posture], turns, damping=2e-2, clear=step >= FREE_STEPS)
        return self._configuration.q.copy()

    def follow(
        self,
        qpos: np.ndarray,
        points: Mapping[str, np.ndarray],
        soles: Mapping[str, Rotation],
        lifts: Mapping[str, float],
    ) -> np.ndarray:
        """The pose nearest to `qpos` [nq] that passes through nothing, [nq].

        Args:
            points: where named points rest, [3] [m].
            soles: how the soles that rest are turned.
            lifts: clearance of bodies above the ground [m].
        """
        self._clear.set_lifts(lifts)
        self._follow.set_target(qpos)
        self._pelvis.set_target(_se3(qpos[:3], Rotation.from_quat(qpos[3:7], scalar_first=True)))
        self._touch.set_target(points)
        turns = {f"{side}_foot": rotation for side, rotation in soles.items()}
        for _ in range(FRAME_STEPS):
            self._step([self._pelvis, self._touch, self._follow], turns, damping=1e-3)
        return self._configuration.q.copy()

    def start_from(self, qpos: np.ndarray) -> None:
        """Make `qpos` [nq] the state from which the next solution is sought."""
        self._configuration.update(qpos)

    def places(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Where these points are in the last solution, [3] [m] each."""
        return {name: place_of(self._configuration, name) for name in names}

    def sole(self, side: str) -> Rotation:
        """How a foot is turned in the last solution."""
        return Rotation.from_quat(self._configuration.data.body(f"{side}_foot").xquat, scalar_first=True)

    def _stand(self, stand: Stand) -> np.ndarray:
        take = Take("stand", [Key(0.0, stand.pose), Key(STILL, stand.pose)])
        qpos = perform(take, Puppet(self._character.model), self._character)[0]
        qpos[:2] += stand.x, stand.y
        return qpos

    def _step(self, tasks: list, turns: Mapping[str, Rotation], damping: float, clear: bool = True) -> None:
        for name, rotation in turns.items():
            self._turns[name].set_target(_se3(np.zeros(3), rotation))
        tasks = [*tasks, *(self._turns[name] for name in turns)]
        limits = [*self._limits, self._clear] if clear else self._limits
        try:
            velocity = mink.solve_ik(self._configuration, tasks, 1.0, SOLVER, damping=damping, limits=limits)
        except mink.NoSolutionFound:  # two overlaps push against each other: neither may grow, the tasks part them
            with self._clear.at_rest():
                velocity = mink.solve_ik(self._configuration, tasks, 1.0, SOLVER, damping=damping, limits=limits)
        self._configuration.integrate_inplace(velocity, 1.0)


def _turns(pose: Low) -> dict[str, Rotation]:
    """How bodies are asked to be turned, in the world."""
    turns = {"torso": attitude(*pose.chest), "head": attitude(*pose.head)}
    turns |= {f"{side}_foot": turn(*angles) for side, angles in pose.soles.items()}
    if pose.blade is not None:
        turns["right_hand"] = blade_rotation(*pose.blade)
    if pose.face is not None:
        turns["left_lower_arm"] = shield_rotation(*pose.face)
    return turns


def _se3(position: np.ndarray, rotation: Rotation) -> mink.SE3:
    return mink.SE3(np.concatenate([rotation.as_quat(scalar_first=True), position]))
