"""Meshes of what a MuJoCo model looks like, a body at a time, in colours and materials that browsers know (glTF)."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
import trimesh
from trimesh.creation import box, capsule, icosphere, revolve
from trimesh.exchange.gltf import export_glb
from trimesh.transformations import quaternion_matrix
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from murmillo.envs import SuiteError

_SHOWN_GROUPS = 3
"""MuJoCo shows the geoms of groups 0, 1 and 2 where nothing else is said."""
_SECTIONS = 32


@dataclass(frozen=True)
class Shape:
    """A geom as a mesh.

    Attributes:
        geom: its number in the model.
        body: of which it is a part, as a number in the model.
        mesh: in the body's frame [m], with its material.
    """

    geom: int
    body: int
    mesh: trimesh.Trimesh


def shapes_of(model: mujoco.MjModel) -> list[Shape]:
    """All geoms that are seen, but for planes, in the model's order.

    Raises:
        SuiteError: a geom of a kind that is not known here.
    """
    seen = (model.geom_group < _SHOWN_GROUPS) & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    return [_shape(model, geom) for geom in np.flatnonzero(seen).tolist()]


def glb(shapes: list[Shape]) -> bytes:
    """One glTF file of these shapes, which are of one body, in its frame."""
    scene = trimesh.Scene()
    for shape in shapes:
        scene.add_geometry(shape.mesh, geom_name=f"geom_{shape.geom}")
    return export_glb(scene, include_normals=True)


def _shape(model: mujoco.MjModel, geom: int) -> Shape:
    kind = int(model.geom_type[geom])
    if kind != mujoco.mjtGeom.mjGEOM_HFIELD and kind not in _MESHES:
        raise SuiteError(
            f"geom {model.geom(geom).name or geom}: a browser is shown {', '.join(_NAMES)} only; "
            "put one of them in its place"
        )
    mesh = _MESHES[kind](model.geom_size[geom]) if kind in _MESHES else _ground(model, int(model.geom_dataid[geom]))
    place = quaternion_matrix(model.geom_quat[geom])
    place[:3, 3] = model.geom_pos[geom]
    mesh.apply_transform(place)
    mesh.visual = TextureVisuals(material=_material(model, geom))
    return Shape(geom, int(model.geom_bodyid[geom]), mesh)


def _material(model: mujoco.MjModel, geom: int) -> PBRMaterial:
    """Of MuJoCo's highlights: what is sharply reflected is smooth, and what reflects nearly all of it is a metal."""
    number = int(model.geom_matid[geom])
    if number < 0:
        return PBRMaterial(baseColorFactor=_linear(model.geom_rgba[geom]), metallicFactor=0.0, roughnessFactor=0.8)
    return PBRMaterial(
        baseColorFactor=_linear(model.mat_rgba[number]),
        metallicFactor=float(model.mat_specular[number]) ** 3,
        roughnessFactor=1.0 - 0.7 * float(model.mat_shininess[number]),
    )


def _linear(rgba: np.ndarray) -> np.ndarray:
    """MuJoCo's colours are those of a screen (sRGB), glTF's are amounts of light."""
    rgb = np.where(rgba[:3] <= 0.04045, rgba[:3] / 12.92, ((rgba[:3] + 0.055) / 1.055) ** 2.4)
    return np.append(rgb, rgba[3]).astype(np.float64)


def _sphere(size: np.ndarray) -> trimesh.Trimesh:
    return icosphere(subdivisions=3, radius=size[0])


def _ellipsoid(size: np.ndarray) -> trimesh.Trimesh:
    mesh = icosphere(subdivisions=3)
    mesh.apply_scale(size)
    return mesh


def _capsule(size: np.ndarray) -> trimesh.Trimesh:
    return capsule(radius=size[0], height=2.0 * size[1], count=(_SECTIONS, _SECTIONS))


def _cylinder(size: np.ndarray) -> trimesh.Trimesh:
    """Its side and its two ends do not share vertices, so that no light bends around the rim."""
    radius, half = size[0], size[1]
    side = revolve([[radius, -half], [radius, half]], sections=_SECTIONS)
    bottom = revolve([[0.0, -half], [radius, -half]], sections=_SECTIONS)
    top = revolve([[radius, half], [0.0, half]], sections=_SECTIONS)
    return side + bottom + top


def _box(size: np.ndarray) -> trimesh.Trimesh:
    mesh = box(extents=2.0 * size)
    mesh.unmerge_vertices()  # its edges are sharp
    return mesh


def _ground(model: mujoco.MjModel, field: int) -> trimesh.Trimesh:
    """The upper side of a height field, by the triangles that the engine collides with."""
    rows, columns, first = (int(of[field]) for of in (model.hfield_nrow, model.hfield_ncol, model.hfield_adr))
    half_x, half_y, top, _ = model.hfield_size[field]
    z = top * model.hfield_data[first : first + rows * columns].reshape(rows, columns)
    x, y = np.meshgrid(np.linspace(-half_x, half_x, columns), np.linspace(-half_y, half_y, rows))
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    across = corner + columns + 1
    faces = np.concatenate([np.stack([corner, corner + 1, across], -1), np.stack([corner, across, across - 1], -1)])
    return trimesh.Trimesh(np.stack([x, y, z], -1).reshape(-1, 3), faces, process=False)


_NAMES = ("sphere", "ellipsoid", "capsule", "cylinder", "box")
_MESHES: dict[int, Callable[[np.ndarray], trimesh.Trimesh]] = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): _sphere,
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): _ellipsoid,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): _capsule,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): _cylinder,
    int(mujoco.mjtGeom.mjGEOM_BOX): _box,
}
