"""What inverse kinematics may not do: joint bounds to first order, also beyond half a turn, and the lowest points."""

import mink
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from murmillo.envs.character import Character
from murmillo.envs.motion.retarget.figure import Figure, nearer
from murmillo.envs.motion.retarget.limits import Ground, JointBounds, lowest_points


@pytest.fixture(scope="module")
def figure(character: Character) -> Figure:
    return Figure(character)


def random_pose(figure: Figure, seed: int) -> np.ndarray:
    """Joints anywhere inside their bounds [nq]."""
    rng = np.random.default_rng(seed)
    return figure.posed(rng.uniform(figure.low, figure.high)[None], figure.character.model.qpos0[None])[0]


@pytest.mark.parametrize("seed", range(5))
def test_the_rows_are_the_rates_of_the_joint_coordinates(figure: Figure, seed: int) -> None:
    model, limit = figure.character.model, JointBounds(figure, gain=1.0)
    pose = model.qpos0.copy() if seed == 0 else random_pose(figure, seed)
    constraint = limit.compute_qp_inequalities(mink.Configuration(model, pose), 1.0)
    assert constraint.G is not None
    assert constraint.h is not None
    rows = len(figure.low)
    coordinates = figure.coordinates(pose[None])[0]
    np.testing.assert_allclose(constraint.h, np.concatenate([figure.high - coordinates, coordinates - figure.low]))
    np.testing.assert_allclose(constraint.G[rows:], -constraint.G[:rows])
    for dof in range(model.nv):
        moved = [pose.copy(), pose.copy()]
        for sign, end in zip((-1.0, 1.0), moved, strict=True):
            mujoco.mj_integratePos(model, end, sign * np.eye(model.nv)[dof], 1e-6)
        rate = np.diff(figure.coordinates(np.array(moved)), axis=0)[0] / 2e-6
        np.testing.assert_allclose(constraint.G[:rows, dof], rate, atol=1e-6)


def test_of_two_rotation_vectors_the_one_nearer_to_the_box() -> None:
    low, high = np.array([-0.5, -3.5, -0.5]), np.array([0.5, 0.5, 0.5])
    beyond = Rotation.from_rotvec([[0.0, -3.4, 0.0]]).as_rotvec()
    assert beyond[0, 1] > 2.8
    np.testing.assert_allclose(nearer(beyond, low, high), [[0.0, -3.4, 0.0]])
    np.testing.assert_array_equal(nearer(np.zeros((1, 3)), low, high), np.zeros((1, 3)))


def test_lowest_points_are_the_lowest_of_the_surface() -> None:
    """Against the shapes' support functions, tilted at random."""
    spec = mujoco.MjSpec()
    quat = Rotation.random(rng=np.random.default_rng(1)).as_quat(scalar_first=True)
    kinds = ("BOX", "SPHERE", "CAPSULE", "CYLINDER")
    for kind in kinds:
        spec.worldbody.add_body(pos=[0.0, 0.0, 0.05]).add_geom(
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"), size=[0.1, 0.2, 0.3], quat=quat
        )
    model = spec.compile()
    configuration = mink.Configuration(model)
    down = -Rotation.from_quat(quat, scalar_first=True).as_matrix()[2]  # of the world, in the geom's axes
    support = {
        "BOX": np.abs(down) @ [0.1, 0.2, 0.3],
        "SPHERE": 0.1,
        "CAPSULE": 0.1 + 0.2 * abs(down[2]),
        "CYLINDER": 0.1 * np.hypot(down[0], down[1]) + 0.2 * abs(down[2]),
    }
    for geom, kind in enumerate(kinds):
        points = lowest_points(model, configuration.data, geom)
        assert points[:, 2].min() == pytest.approx(0.05 - support[kind]), kind
    deepest = max(support.values()) - 0.05
    assert Ground(model).depth(configuration) == pytest.approx(deepest)
