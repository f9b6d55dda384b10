"""What inverse kinematics (mink) needs near the ground: points that touch, and a body that passes through nothing."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import mink
import mujoco
import numpy as np

from murmillo.envs.motion.authored.feet import HEEL, TOE

# Points that are no body's origin, as a body and an offset in its frame [m]; a body's own name is its origin.
POINTS = {
    f"{side}_{part}": (f"{side}_foot", offset)
    for side in ("left", "right")
    for part, offset in (("toe", TOE), ("heel", HEEL))
}
LOW, FIRM, GENTLE = 0.13, 20.0, 4.0  # a place up to this height [m] is on the ground; the costs there and above
NEAR = 0.10  # what is farther apart than this is left out of account [m]
PUSH = 0.02  # how far what overlaps is pushed apart in a step [m]
TOUCHING = 1e-9  # nearer than this, two geoms have no normal between them [m]
# Groups of geoms that must not pass through each other.
SWORD = ("blade", "hilt")
SHIELD = ("shield",)
RIGHT_ARM = ("right_hand", "right_lower_arm")
TRUNK = ("pelvis", "waist", "torso", "head")
LEGS = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("thigh", "shin", "foot"))
LEFT_LEG, RIGHT_LEG = LEGS[:3], LEGS[3:]
APART = (
    (SWORD, (*TRUNK, *LEGS, *SHIELD, "left_hand", "left_lower_arm")),
    (SHIELD, (*TRUNK, *LEGS, *RIGHT_ARM)),
    (RIGHT_ARM, (*TRUNK, *LEGS)),
    (("left_hand", "left_lower_arm"), (*TRUNK, *LEGS)),
    (LEFT_LEG, RIGHT_LEG),
)


class Touch(mink.Task):
    """Brings named points of the body to places in the world: firmly to the ground, gently to places in the air."""

    def __init__(self) -> None:
        super().__init__(cost=np.zeros(0))
        self._points: list[tuple[str, np.ndarray, np.ndarray]] = []

    def set_target(self, places: Mapping[str, np.ndarray]) -> None:
        """Where each named point is to be, [3] [m]."""
        self._points = [(*POINTS.get(name, (name, np.zeros(3))), np.asarray(place)) for name, place in places.items()]
        self.cost = np.repeat([FIRM if place[2] < LOW else GENTLE for _, _, place in self._points], 3)

    def compute_error(self, configuration: mink.Configuration) -> np.ndarray:
        return np.concatenate(
            [_place(configuration, body, offset) - place for body, offset, place in self._points] or [np.zeros(0)]
        )

    def compute_jacobian(self, configuration: mink.Configuration) -> np.ndarray:
        jacobian = np.zeros((len(self._points), 3, configuration.nv))
        for rows, (body, offset, _) in zip(jacobian, self._points, strict=True):
            where = _place(configuration, body, offset)
            mujoco.mj_jac(configuration.model, configuration.data, rows, None, where, configuration.model.body(body).id)
        return jacobian.reshape(-1, configuration.nv)


def place_of(configuration: mink.Configuration, name: str) -> np.ndarray:
    """Where a named point is [3] [m]."""
    return _place(configuration, *POINTS.get(name, (name, np.zeros(3))))


def _place(configuration: mink.Configuration, body: str, offset: np.ndarray) -> np.ndarray:
    data = configuration.data.body(body)
    return data.xpos + data.xmat.reshape(3, 3) @ offset


class Clearance(mink.Limit):
    """Keeps every geom above the floor and the pairs of `APART` from passing through each other.

    What overlaps already is pushed apart, by up to `PUSH` a step.
    """

    def __init__(self, model: mujoco.MjModel, gap: float = 0.003, gain: float = 0.8) -> None:
        self._floor = _Floor(model)
        self._pairs = [(model.geom(a).id, model.geom(b).id) for some, others in APART for a in some for b in others]
        self._gap, self._gain = gap, gain
        self._push = PUSH

    def set_lifts(self, lifts: Mapping[str, float]) -> None:
        """Keep these bodies so far above the floor [m], the others above it."""
        self._floor.set_lifts(lifts)

    @contextmanager
    def at_rest(self) -> Iterator[None]:
        """Without the push: what overlaps may not overlap more, which can always be had."""
        self._push = 0.0
        try:
            yield
        finally:
            self._push = PUSH

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        model, data = configuration.model, configuration.data
        distances, rows = self._floor.measure(model, data)
        fromto, jacobian = np.empty(6), np.empty((2, 3, configuration.nv))
        for a, b in self._pairs:
            reach = model.geom_rbound[a] + model.geom_rbound[b] + NEAR
            if np.linalg.norm(data.geom_xpos[a] - data.geom_xpos[b]) > reach:
                continue
            distance = mujoco.mj_geomDistance(model, data, a, b, NEAR, fromto)
            if distance >= NEAR or abs(distance) < TOUCHING:
                continue
            normal = (fromto[3:] - fromto[:3]) / distance  # from a to b, also where they overlap
            for jac, point, geom in zip(jacobian, (fromto[:3], fromto[3:]), (a, b), strict=True):
                mujoco.mj_jac(model, data, jac, None, point, model.geom_bodyid[geom])
            distances.append(distance - self._gap)
            rows.append(normal @ (jacobian[1] - jacobian[0]))
        bounds = np.maximum(self._gain * np.array(distances), -self._push)
        return mink.Constraint(G=-np.array(rows).reshape(-1, configuration.nv), h=bounds)


class _Floor:
    """Points of every geom that may be its lowest, each with a radius around it."""

    def __init__(self, model: mujoco.MjModel) -> None:
        bodies, offsets, radii = [], [], []
        for geom in range(model.ngeom):
            if model.geom_bodyid[geom] == 0:
                continue
            points, radius = _extremes(int(model.geom_type[geom]), model.geom_size[geom])
            rotation = np.empty(9)
            mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
            offsets += list(model.geom_pos[geom] + points @ rotation.reshape(3, 3).T)
            bodies += [int(model.geom_bodyid[geom])] * len(points)
            radii += [radius] * len(points)
        self._bodies, self._offsets, self._radii = np.array(bodies), np.array(offsets), np.array(radii)
        self._names = [model.body(body).name for body in bodies]
        self.set_lifts({})

    def set_lifts(self, lifts: Mapping[str, float]) -> None:
        self._lifts = np.array([lifts.get(name, 0.0) for name in self._names])

    def measure(self, model: mujoco.MjModel, data: mujoco.MjData) -> tuple[list[float], list[np.ndarray]]:
        """Heights [m] of the points near the floor, and their derivatives [nv]."""
        rotation = data.xmat[self._bodies].reshape(-1, 3, 3)
        points = data.xpos[self._bodies] + np.einsum("pij,pj->pi", rotation, self._offsets)
        heights = points[:, 2] - self._radii - self._lifts
        near = np.flatnonzero(heights < NEAR)
        rows = np.empty((len(near), 3, model.nv))
        for row, i in zip(rows, near, strict=True):
            mujoco.mj_jac(model, data, row, None, points[i], self._bodies[i])
        return list(heights[near]), list(rows[:, 2])


def _extremes(kind: int, size: np.ndarray) -> tuple[np.ndarray, float]:
    """Points [P, 3] in the frame of a geom whose swelling by a radius covers it [m]."""
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3)
        return corners * size, 0.0
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        rim = size[0] * np.stack([np.cos(angle), np.sin(angle)], -1)
        return np.concatenate([np.column_stack([rim, np.full(24, side * size[1])]) for side in (-1.0, 1.0)]), 0.0
    ends = (-1.0, 1.0) if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else (0.0,)
    return np.array([[0.0, 0.0, end * size[1]] for end in ends]), float(size[0])
