"""The character as a puppet: poses in the words of an animator, solved to joint angles by inverse kinematics (mink)."""

from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import mink
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from murmillo.envs.character import joint_box

SOLVER = "daqp"
KNEE_SLACK = 0.10  # the knees never straighten beyond this [rad]
FootTargets = dict[str, tuple[np.ndarray, Rotation]]  # of each side: ankle position [m] and foot rotation, world
POSE_STEPS, FOLLOW_STEPS = 60, 6  # Gauss-Newton steps a key pose and a frame take
CHEST_TO_NECK = 0.2239  # torso origin to the base of the neck [m]


@dataclass(frozen=True)
class Pose:
    """What the body does, in the heading frame (x ahead, y left, z up). Metres and degrees; turns are yaw, pitch
    (forward is positive) and roll (to the right is positive).

    `height` is the pelvis above the ground, `weight` the share of the load on the right foot. `hand` (right) and
    `shield` (its centre) are measured from the base of the neck. `blade` is azimuth, elevation and roll (+90: the edge
    leads to the left); elevation may pass 90 to point back over the head. `face` is the azimuth and elevation that the
    shield looks to, and the slope of the forearm behind it (0: level, the hand to the right; 90: the hand up).
    """

    height: float = 0.768
    weight: float = 0.5
    hips: tuple[float, float, float] = (-14.0, 4.0, 0.0)
    chest: tuple[float, float, float] = (-24.0, 6.0, 0.0)
    gaze: tuple[float, float] = (0.0, 0.0)
    hand: tuple[float, float, float] = (0.10, -0.30, -0.29)
    blade: tuple[float, float, float] = (5.0, 30.0, 0.0)
    shield: tuple[float, float, float] = (0.33, 0.09, -0.17)
    face: tuple[float, float, float] = (12.0, 0.0, 30.0)

    def but(self, **changes: Any) -> "Pose":
        """This pose with some of its words changed."""
        return replace(self, **changes)


def turn(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> Rotation:
    """Yaw, then pitch forward, then roll to the right [deg]."""
    return Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True)


def blade_rotation(azimuth: float, elevation: float, roll: float) -> Rotation:
    """Rotation of the sword hand whose x axis is the blade and whose -z axis the edge [deg]."""
    return Rotation.from_euler("ZYX", [azimuth, -elevation, roll], degrees=True)


def shield_rotation(azimuth: float, elevation: float, slope: float) -> Rotation:
    """Rotation of the left forearm whose y axis faces (azimuth, elevation) and whose -z axis runs at `slope` [deg]."""
    level = Rotation.from_matrix([[0, 1, 0], [0, 0, 1], [1, 0, 0]])  # y -> ahead, -z -> right, x -> up
    return turn(azimuth, -elevation) * Rotation.from_euler("x", slope, degrees=True) * level


class BallBox(mink.Limit):
    """Keeps the exponential map of each ball joint inside its box."""

    def __init__(self, model: mujoco.MjModel, gain: float = 0.9) -> None:
        self._gain = gain
        balls = (model.joint(i) for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_BALL)
        self._joints = [
            (int(joint.qposadr[0]), int(joint.dofadr[0]), *joint_box(model, joint.name).T) for joint in balls
        ]

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        rows, bounds = [], []
        for qpos, dof, low, high in self._joints:
            rotation = mink.SO3(configuration.q[qpos : qpos + 4])
            value = rotation.log()
            rate = np.zeros((3, configuration.nv))
            rate[:, dof : dof + 3] = mink.SO3.rjacinv(value)  # of the exponential map, by the body-frame velocity
            rows += [rate, -rate]
            bounds += [self._gain * (high - value), self._gain * (value - low)]
        return mink.Constraint(G=np.vstack(rows), h=np.hstack(bounds))


class Puppet:
    """Solves poses and feet to joint angles; keeps its last solution as the start of the next."""

    def __init__(self, model: mujoco.MjModel) -> None:
        model = deepcopy(model)
        for knee in ("right_knee", "left_knee"):  # never locked straight
            model.joint(knee).range[0] = KNEE_SLACK
        self._configuration = mink.Configuration(model)
        self._limits = [mink.ConfigurationLimit(model), BallBox(model)]
        self._feet = {
            side: mink.FrameTask(f"{side}_foot", "body", position_cost=20.0, orientation_cost=6.0)
            for side in ("left", "right")
        }
        self._height = mink.FrameTask("pelvis", "body", position_cost=[0.0, 0.0, 8.0], orientation_cost=4.0)
        self._pelvis = mink.FrameTask("pelvis", "body", position_cost=8.0, orientation_cost=4.0)
        self._balance = mink.ComTask(cost=[8.0, 8.0, 0.0])
        self._chest = mink.FrameTask("torso", "body", position_cost=0.0, orientation_cost=4.0)
        self._head = mink.FrameTask("head", "body", position_cost=0.0, orientation_cost=3.0)
        self._hand = mink.FrameTask("right_hand", "body", position_cost=6.0, orientation_cost=1.2)
        self._shield = mink.FrameTask("key_shield", "site", position_cost=5.0, orientation_cost=[1.2, 0.4, 1.2])
        self._posture = mink.PostureTask(model, cost=_costs(model, body=0.06, legs=0.06, ankle_twist=1.0))
        self._follow = mink.PostureTask(model, cost=_costs(model, body=10.0, legs=0.08, ankle_twist=1.0))
        self._relaxed = relaxed(model)

    def pose(self, pose: Pose, feet: FootTargets, support: np.ndarray, heading: float) -> np.ndarray:
        """Joint angles of a key pose, [nq].

        Args:
            feet: where the feet are.
            support: [2] the point on the ground under the centre of mass [m].
            heading: of the frame in which the pose is told [deg].
        """
        frame = turn(heading)
        self._set_feet(feet)
        self._set_hips(pose.height, frame * turn(*pose.hips), support)
        chest = frame * turn(*pose.chest)
        self._chest.set_target(_se3(np.zeros(3), chest))
        self._head.set_target(_se3(np.zeros(3), frame * turn(pose.gaze[0], -pose.gaze[1])))
        start = self._relaxed.copy()
        start[:2] = support
        start[3:7] = _wxyz(frame * turn(*pose.hips))
        self._posture.set_target(self._relaxed)
        self._configuration.update(start)
        tasks = [*self._feet.values(), self._height, self._balance, self._chest, self._head]
        tasks += [self._hand, self._shield, self._posture]
        hand, shield = (frame * blade_rotation(*pose.blade)), (frame * shield_rotation(*pose.face))
        for _ in range(POSE_STEPS):
            torso = self._configuration.get_transform_frame_to_world("torso", "body")
            neck = torso.translation() + chest.apply([0.0, 0.0, CHEST_TO_NECK])
            self._hand.set_target(_se3(neck + frame.apply(pose.hand), hand))
            self._shield.set_target(_se3(neck + frame.apply(pose.shield), shield))
            self._step(tasks, damping=2e-2)
        return self._configuration.q.copy()

    def follow(
        self,
        joints: np.ndarray,
        feet: FootTargets,
        pelvis: np.ndarray,
        hips: Rotation,
        support: np.ndarray | None = None,
    ) -> np.ndarray:
        """Joint angles nearest to `joints` [nq] with the feet and the pelvis where they are asked, [nq].

        Given `support` [2], the centre of mass is brought over it and only the height of `pelvis` [3] counts.
        """
        self._set_feet(feet)
        self._follow.set_target(joints)
        if support is None:
            self._pelvis.set_target(_se3(pelvis, hips))
            tasks = [*self._feet.values(), self._pelvis, self._follow]
        else:
            self._set_hips(float(pelvis[2]), hips, support)
            tasks = [*self._feet.values(), self._height, self._balance, self._follow]
        for _ in range(FOLLOW_STEPS):
            self._step(tasks, damping=1e-4)
        return self._configuration.q.copy()

    def centres_of_mass(self, qpos: np.ndarray) -> np.ndarray:
        """Of the whole body in the poses qpos [F, nq]: [F, 3] [m]."""
        model, data = self._configuration.model, self._configuration.data
        centres = np.empty((len(qpos), 3))
        for centre, data.qpos in zip(centres, qpos, strict=True):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            centre[:] = data.subtree_com[1]
        return centres

    def start_from(self, qpos: np.ndarray) -> None:
        """Make `qpos` [nq] the state from which the next solution is sought."""
        self._configuration.update(qpos)

    def _set_feet(self, feet: FootTargets) -> None:
        for side, (position, rotation) in feet.items():
            self._feet[side].set_target(_se3(position, rotation))

    def _set_hips(self, height: float, rotation: Rotation, support: np.ndarray) -> None:
        self._height.set_target(_se3(np.array([*support, height]), rotation))
        self._balance.set_target(np.array([*support, 0.0]))

    def _step(self, tasks: list, damping: float) -> None:
        velocity = mink.solve_ik(self._configuration, tasks, 1.0, SOLVER, damping=damping, limits=self._limits)
        self._configuration.integrate_inplace(velocity, 1.0)


def _costs(model: mujoco.MjModel, body: float, legs: float, ankle_twist: float) -> np.ndarray:
    """Posture cost of each degree of freedom [nv]; a stiff ankle twist keeps the knees over the feet."""
    costs = np.full(model.nv, body)
    for side in ("left", "right"):
        hip, ankle = (int(model.joint(f"{side}_{name}").dofadr[0]) for name in ("hip", "ankle"))
        costs[hip : ankle + 2] = legs
        costs[ankle + 2] = ankle_twist
    return costs


def relaxed(model: mujoco.MjModel) -> np.ndarray:
    """A loose fighting crouch, [nq]: what the joints drift to where nothing else is asked of them."""
    qpos = model.qpos0.copy()
    qpos[2] = 0.79
    for name, value in RELAXED.items():
        joint = model.joint(name)
        start = int(joint.qposadr[0])
        if len(joint.qpos0) == 4:
            qpos[start : start + 4] = _wxyz(Rotation.from_rotvec(value, degrees=True))
        else:
            qpos[start] = np.radians(value[0])
    return qpos


RELAXED = {
    "right_shoulder": (-20.0, -10.0, 10.0),
    "right_elbow": (-85.0,),
    "right_wrist": (0.0, 15.0, 0.0),
    "left_shoulder": (20.0, -35.0, -50.0),
    "left_elbow": (-95.0,),
    "right_hip": (-8.0, -25.0, -24.0),
    "right_knee": (45.0,),
    "right_ankle": (0.0, -20.0, 0.0),
    "left_hip": (8.0, -35.0, 18.0),
    "left_knee": (45.0,),
    "left_ankle": (0.0, -12.0, 0.0),
}


def _wxyz(rotation: Rotation) -> np.ndarray:
    return rotation.as_quat(scalar_first=True)


def _se3(position: np.ndarray, rotation: Rotation) -> mink.SE3:
    return mink.SE3(np.concatenate([_wxyz(rotation), position]))
