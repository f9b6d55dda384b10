"""What inverse kinematics may not do: leave a joint's bounds, or push a body into the ground."""

import mink
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from murmillo.envs.motion.retarget.figure import Figure, nearer

_NEAR = 0.12  # only what is lower can be pushed into the ground by one step [m]


class JointBounds(mink.Limit):
    """Keeps hinges in their ranges and the exponential map of each ball joint in its box, all in one block of rows."""

    def __init__(self, figure: Figure, gain: float = 0.9) -> None:
        self._figure, self._gain = figure, gain
        joints = figure.character.joints
        balls = [joint for joint in joints if joint.kind == "ball"]
        self._hinges = [joint for joint in joints if joint.kind == "hinge"]
        self._ball_qpos = np.array([np.arange(joint.qpos.start, joint.qpos.stop) for joint in balls])
        self._ball_dof = np.array([np.arange(joint.dof.start, joint.dof.stop) for joint in balls])
        self._ball_action = np.array([np.arange(joint.action.start, joint.action.stop) for joint in balls])
        self._hinge_qpos = [joint.qpos.start for joint in self._hinges]
        self._hinge_action = [joint.action.start for joint in self._hinges]
        self._rows = np.zeros((len(figure.low), figure.character.model.nv))
        for joint in self._hinges:
            self._rows[joint.action, joint.dof] = 1.0

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        del dt
        low, high = self._figure.low, self._figure.high
        value = np.empty(len(low))
        q = configuration.q
        value[self._hinge_action] = q[self._hinge_qpos]
        rotvec = Rotation.from_quat(q[self._ball_qpos], scalar_first=True).as_rotvec()
        rotvec = nearer(rotvec, low[self._ball_action], high[self._ball_action])
        value[self._ball_action] = rotvec
        self._rows[self._ball_action[:, :, None], self._ball_dof[:, None, :]] = _right_jacobian_inverse(rotvec)
        bounds = self._gain * np.concatenate([high - value, value - low])
        return mink.Constraint(G=np.concatenate([self._rows, -self._rows]), h=bounds)


class Ground(mink.Limit):
    """Keeps the lowest point of every body above the ground."""

    def __init__(self, model: mujoco.MjModel, gain: float = 0.9) -> None:
        self._gain = gain
        self._geoms = np.flatnonzero(model.geom_bodyid)  # those of the world, body 0, are the ground
        self._jacobian = np.empty((3, model.nv))

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        del dt
        rows, bounds = [], []
        for geom in self._low_geoms(configuration, _NEAR):
            body = configuration.model.geom_bodyid[geom]
            for point in lowest_points(configuration.model, configuration.data, geom):
                mujoco.mj_jac(configuration.model, configuration.data, self._jacobian, None, point, body)
                rows.append(-self._jacobian[2])
                bounds.append(self._gain * point[2])
        return mink.Constraint(G=np.array(rows), h=np.array(bounds)) if rows else mink.Constraint()

    def depth(self, configuration: mink.Configuration) -> float:
        """How far the lowest body is below the ground, or 0 [m]."""
        points = [
            lowest_points(configuration.model, configuration.data, geom)[:, 2].min()
            for geom in self._low_geoms(configuration, 0.0)
        ]
        return max(0.0, -min(points, default=0.0))

    def _low_geoms(self, configuration: mink.Configuration, height: float) -> np.ndarray:
        """Geoms whose bounding sphere reaches below this height [m]."""
        bottom = configuration.data.geom_xpos[self._geoms, 2] - configuration.model.geom_rbound[self._geoms]
        return self._geoms[bottom < height]


def lowest_points(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """Points [n, 3] of a sphere, capsule, cylinder or box in the world of which one is its lowest [m]."""
    centre, turn, size = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3), model.geom_size[geom]
    kind = model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size
        points = centre + corners @ turn.T
        return points[np.argsort(points[:, 2])[:4]]
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return centre[None] - [0.0, 0.0, size[0]]
    ends = centre + np.array([[-1.0], [1.0]]) * size[1] * turn[:, 2]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return ends - [0.0, 0.0, size[0]]
    axis = turn[:, 2]
    downhill = axis * axis[2] - [0.0, 0.0, 1.0]  # across the axis
    return ends + size[0] * downhill / max(float(np.linalg.norm(downhill)), 1e-6)


def _right_jacobian_inverse(rotvec: np.ndarray) -> np.ndarray:
    """[n, 3, 3]: the rate of the rotation vectors [n, 3] by the angular velocity in the child's frame.

    I + [v]/2 + (1/a^2 - (1 + cos a) / (2 a sin a)) [v]^2 (Sola et al. 2018, A micro Lie theory, eq. 144).
    """
    angle = np.linalg.norm(rotvec, axis=1)[:, None, None]
    cross = np.zeros((len(rotvec), 3, 3))
    x, y, z = rotvec.T
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross -= cross.transpose(0, 2, 1)
    safe = np.maximum(angle, 1e-3)
    # half (1 + cos) / sin is half the cotangent of half the angle, which stays finite at pi
    factor = np.where(angle > 1e-3, 1.0 / safe**2 - 0.5 / (safe * np.tan(0.5 * safe)), 1.0 / 12.0)
    return np.eye(3) + 0.5 * cross + factor * (cross @ cross)
