"""Every geom that MuJoCo would draw is a mesh in the right place and of the right size."""

import json

import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs import SuiteError
from murmillo.envs.character import load_character
from murmillo.envs.scene import Scene, add_box
from murmillo.envs.terrain import Terrain, TerrainConfig

pytest.importorskip("trimesh", reason="the extra play is not installed")

from murmillo.viewer.shapes import glb, shapes_of  # after the extra was looked for

PLANE, SPHERE, CAPSULE = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE
SIZE = {  # half lengths of the box around a geom of this size
    SPHERE: lambda size: size[[0, 0, 0]],
    CAPSULE: lambda size: np.array([size[0], size[0], size[0] + size[1]]),
    mujoco.mjtGeom.mjGEOM_CYLINDER: lambda size: size[[0, 0, 1]],
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: lambda size: size,
    mujoco.mjtGeom.mjGEOM_BOX: lambda size: size,
}


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return Scene(load_character(), lambda spec: add_box(spec, "crate", (0.4, 0.6, 1.8), 8.0)).render_model()


def in_geom_frame(model: mujoco.MjModel, geom: int, points: np.ndarray) -> np.ndarray:
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    return (points - model.geom_pos[geom]) @ rotation.reshape(3, 3)


def test_all_geoms_that_are_seen_have_a_mesh_on_their_body(model: mujoco.MjModel) -> None:
    shapes = shapes_of(model)
    assert [shape.geom for shape in shapes] == [i for i in range(model.ngeom) if model.geom_type[i] != PLANE]
    assert len(shapes) == 79  # 78 of the murmillo, and the crate
    assert all(shape.body == model.geom_bodyid[shape.geom] for shape in shapes)


def test_meshes_have_the_sizes_of_their_geoms_and_look_outward(model: mujoco.MjModel) -> None:
    for shape in shapes_of(model):
        points = in_geom_frame(model, shape.geom, shape.mesh.vertices)
        expected = SIZE[mujoco.mjtGeom(int(model.geom_type[shape.geom]))](model.geom_size[shape.geom])
        np.testing.assert_allclose(np.abs(points).max(0), expected, rtol=0.01)
        normals = in_geom_frame(model, shape.geom, shape.mesh.vertex_normals + model.geom_pos[shape.geom])
        assert ((points * normals).sum(-1) > 0.0).all(), shape.geom


def test_uneven_ground_is_where_the_engine_has_it() -> None:
    terrain = Terrain(TerrainConfig(kind="mixed", tiles=1))
    (ground,) = [shape for shape in shapes_of(load_character("humanoid", terrain.edit).model) if shape.body == 0]
    corners = torch.from_numpy(np.array(ground.mesh.vertices))
    np.testing.assert_allclose(ground.mesh.vertices[:, 2], terrain.height(corners), atol=1e-6)
    middles = torch.from_numpy(np.array(ground.mesh.triangles_center))
    np.testing.assert_allclose(ground.mesh.triangles_center[:, 2], terrain.height(middles), atol=1e-6)
    assert np.ptp(ground.mesh.vertices[:, 2]) > 0.1
    assert (ground.mesh.face_normals[:, 2] > 0.0).all()


def test_a_body_is_one_file_with_the_materials_of_its_geoms(model: mujoco.MjModel) -> None:
    head = model.body("head").id
    shapes = [shape for shape in shapes_of(model) if shape.body == head]
    data = glb(shapes)
    content = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert len(content["meshes"]) == len(shapes)
    assert all("NORMAL" in mesh["primitives"][0]["attributes"] for mesh in content["meshes"])
    metals = {material["pbrMetallicRoughness"]["metallicFactor"] > 0.5 for material in content["materials"]}
    assert metals == {True, False}  # the helmet and the neck
    bronze = np.array([0.72, 0.52, 0.26])
    colours = np.array([material["pbrMetallicRoughness"]["baseColorFactor"][:3] for material in content["materials"]])
    assert np.abs(colours ** (1.0 / 2.2) - bronze).max(-1).min() < 0.02  # light, of which the screen makes the colour


def test_a_geom_of_another_kind_is_refused_by_name() -> None:
    spec = load_character().spec()
    spec.add_mesh(name="rock", uservert=[0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])
    spec.worldbody.add_geom(name="rock", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="rock")
    with pytest.raises(SuiteError, match="geom rock"):
        shapes_of(spec.compile())
