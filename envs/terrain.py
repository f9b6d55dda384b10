"""Uneven ground: one height field under all worlds, its heights anywhere, and the map that a character sees of it."""

from dataclasses import dataclass
from itertools import product
from typing import Literal

import mujoco
import numpy as np
import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.devices import Placed
from murmillo.envs.errors import SuiteError
from murmillo.envs.geometry import geom_places
from murmillo.envs.rotations import heading
from murmillo.envs.tiles import OBSTACLE_HEIGHT, TILE, TILES, Heights, obstacle

KINDS = ("flat", *TILES, "mixed")
MAP_SPACING = 0.1
MAP_AHEAD, MAP_ASIDE = (-1.0, 2.4), (-1.7, 1.7)
MAP_SHAPE = (35, 35)
"""The map's points [m], ahead and to the left of the root (AdaptNet, section 8.3.2)."""

_MARGIN = 3.0
"""[m] Level ground around the tiles."""
_BASE = 1.0
"""[m] Thickness of the ground under its lowest place."""
_ROOM = 1.0
"""[m] No obstacle is nearer to where an episode begins: one may begin lying."""
_SPOTS = 64
"""Places on each tile where episodes begin."""


@dataclass
class TerrainConfig:
    """The ground.

    Attributes:
        kind: "flat", a kind of tile ("slopes", "rough", "steps", "stones"), or "mixed", of which each tile has one.
        obstacles: how many blocks of 2 m height stand on each tile.
        tiles: how many tiles of 6 m lie along each side; worlds begin on them by turns.
        spacing: of the points between which heights are linear [m].
        seed: of all that is random about it.
    """

    kind: Literal["flat", "slopes", "rough", "steps", "stones", "mixed"] = "flat"
    obstacles: int = 0
    tiles: int = 8
    spacing: float = 0.1
    seed: int = 0


class Terrain:
    """Heights over a square field about the world's origin.

    Heights between the grid's points are those of the triangles that the engine collides with.
    """

    def __init__(self, config: TerrainConfig) -> None:
        random = np.random.default_rng(config.seed)
        self.spacing = config.spacing
        self.half = 0.5 * config.tiles * TILE + _MARGIN
        """Half the field's edge [m]."""
        ground, blocks = _field(config, random)
        self._heights = ground + OBSTACLE_HEIGHT * blocks
        spots, planes = torch.from_numpy(_spots(config, blocks, random)), torch.from_numpy(_planes(self._heights))
        self._spots, self._planes, self._planes_float32 = Placed(spots), Placed(planes), Placed(planes.float())
        ahead, aside = (torch.linspace(*ends, n) for ends, n in zip((MAP_AHEAD, MAP_ASIDE), MAP_SHAPE, strict=True))
        x, y = torch.meshgrid(ahead, aside, indexing="ij")
        self._map_points = Placed(torch.stack((x.flatten(), y.flatten(), torch.ones_like(x).flatten())))

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Lay it out in place of the floor."""
        low, high = self._heights.min(), self._heights.max()
        rows, columns = self._heights.shape
        size = [self.half, self.half, max(high - low, 1e-3), _BASE]
        spec.add_hfield(name="terrain", size=size, nrow=rows, ncol=columns, userdata=self._heights.ravel())
        floor = spec.geom("floor")
        floor.type, floor.hfieldname, floor.pos = mujoco.mjtGeom.mjGEOM_HFIELD, "terrain", [0.0, 0.0, low]

    def height(self, pos_w: Tensor) -> Tensor:
        """Heights of the ground [...] [m] at the places pos_w [..., 2 or more]; beyond the field, its rim's."""
        x, y = ((pos_w[..., :2].double() + self.half) / self.spacing).unbind(-1)
        return self._interpolate(x, y, self._planes.on(x.device))

    def map(self, root_pos_w: Tensor, root_quat_w: Tensor) -> Tensor:
        """[n, 35, 35] float32 heights of the ground about each root [m], over the ground under it.

        Rows go ahead from 1 m behind to 2.4 m before the root, columns to the left from -1.7 m to 1.7 m, 0.1 m apart;
        both turn with the root's heading.

        Args:
            root_pos_w: [n, 3] [m]; root_quat_w: [n, 4].
        """
        yaw = heading(root_quat_w)
        c, s = yaw.cos() / self.spacing, yaw.sin() / self.spacing
        x, y = ((root_pos_w[:, :2] + self.half) / self.spacing).unbind(-1)
        points = self._map_points.on(x.device)
        x = torch.stack((c, -s, x), dim=-1).float() @ points
        y = torch.stack((s, c, y), dim=-1).float() @ points
        heights = self._interpolate(x, y, self._planes_float32.on(x.device))
        return (heights - self.height(root_pos_w).float().unsqueeze(-1)).unflatten(-1, MAP_SHAPE)

    def contains(self, pos_w: Tensor) -> Tensor:
        """[...] bool: the places pos_w [..., 2 or more] are half a metre or more within the field."""
        return (pos_w[..., :2].abs() < self.half - 0.5).all(-1)

    def settle(self, character: Character, qpos: Tensor, worlds: Tensor, generator: torch.Generator) -> Tensor:
        """By how much [n, 3] [m] to move poses qpos [n, nq] of level ground to somewhere on their worlds' tiles.

        Nothing of them is then below the ground, by the middles of their geoms.
        """
        spot = torch.randint(_SPOTS, (len(worlds),), generator=generator)
        spots = self._spots.on(worlds.device)
        place = spots[worlds % len(spots), spot]
        by = torch.cat((place - qpos[:, :2], self.height(place).unsqueeze(-1)), dim=-1)
        centre, lowest = geom_places(character, qpos)
        above = lowest + by[:, 2:] - self.height(centre[..., :2] + by[:, None, :2])
        by[:, 2] += (-above.amin(-1)).clamp_min(0.0)
        return by

    def _interpolate(self, x: Tensor, y: Tensor, planes: Tensor) -> Tensor:
        """Heights at the coordinates x, y [...] of the grid, in units of its spacing; x and y are used up.

        All is done in place: memory is what costs time here, three times as much without.
        """
        cells = self._heights.shape[0] - 1
        for coordinate in (x, y):
            coordinate.clamp_(0.0, cells * (1.0 - 1e-7))
        column, triangle = x.int(), y.int()
        x -= column
        y -= triangle
        triangle.mul_(cells).add_(column).mul_(2).add_(x > y)
        height, along_x, along_y = planes.index_select(0, triangle.flatten()).unbind(-1)
        return torch.addcmul(height, along_x, x.flatten()).addcmul_(along_y, y.flatten()).unflatten(0, x.shape)


def make_terrain(config: TerrainConfig) -> Terrain | None:
    """The terrain; None where the ground is flat and empty, so that the floor of the MJCF will do.

    Raises:
        SuiteError: a setting that cannot be, or obstacles that leave no room to stand.
    """
    _check(config)
    return Terrain(config) if is_uneven(config) else None


def is_uneven(config: TerrainConfig) -> bool:
    """Whether there is a map of heights to be seen."""
    return config.kind != "flat" or config.obstacles > 0


def _check(config: TerrainConfig) -> None:
    if config.kind not in KINDS:
        raise SuiteError(f"terrain.kind={config.kind}: no such ground; there are: {', '.join(KINDS)}")
    if not (isinstance(config.tiles, int) and 1 <= config.tiles <= 16):
        raise SuiteError(f"terrain.tiles={config.tiles}: needs a number from 1 to 16")
    if not config.spacing <= MAP_SPACING:
        raise SuiteError(
            f"terrain.spacing={config.spacing}: is too coarse for a map of {MAP_SPACING} m; take at most {MAP_SPACING}"
        )
    if not config.spacing >= 0.05 or not np.isclose(TILE / config.spacing, round(TILE / config.spacing)):
        raise SuiteError(f"terrain.spacing={config.spacing}: needs a whole fraction of {TILE:g} m, of at least 0.05 m")
    for name in ("obstacles", "seed"):
        value = getattr(config, name)
        if not (isinstance(value, int) and value >= 0):
            raise SuiteError(f"terrain.{name}={value}: needs at least 0, a whole number")


def _field(config: TerrainConfig, random: np.random.Generator) -> tuple[Heights, Heights]:
    """Heights of the ground [R, C] [m], rows along y, and where obstacles stand on it, 1 or 0."""
    edge = round((config.tiles * TILE + 2.0 * _MARGIN) / config.spacing) + 1
    ground, blocks = np.zeros((edge, edge)), np.zeros((edge, edge))
    points = np.linspace(0.0, TILE, round(TILE / config.spacing) + 1)
    x, y = np.meshgrid(points, points)
    for window in _windows(config):
        kind = str(random.choice(list(TILES))) if config.kind == "mixed" else config.kind
        if kind != "flat":
            ground[window] = TILES[kind](x, y, random)
        for _ in range(config.obstacles):
            blocks[window] = np.maximum(blocks[window], obstacle(x, y, random))
    return ground, blocks


def _spots(config: TerrainConfig, blocks: Heights, random: np.random.Generator) -> Heights:
    """Places [T, S, 2] [m] on each of T tiles that are free of obstacles all around."""
    room = round(_ROOM / config.spacing)
    near = torch.nn.functional.max_pool2d(torch.from_numpy(blocks)[None], 2 * room + 1, stride=1, padding=room)
    free = near[0].numpy() == 0.0
    half = 0.5 * (len(blocks) - 1) * config.spacing
    spots = []
    for rows, columns in _windows(config):
        places = np.argwhere(free[rows, columns])
        if not len(places):
            raise SuiteError(f"terrain.obstacles={config.obstacles}: leave no room to stand on a tile; take fewer")
        chosen = places[random.integers(len(places), size=_SPOTS)] + (rows.start, columns.start)
        spots.append(chosen[:, ::-1] * config.spacing - half)
    return np.stack(spots)


def _windows(config: TerrainConfig) -> list[tuple[slice, slice]]:
    """Rows and columns of each tile; neighbours share their edges."""
    cells, margin = round(TILE / config.spacing), round(_MARGIN / config.spacing)
    parts = [slice(margin + i * cells, margin + (i + 1) * cells + 1) for i in range(config.tiles)]
    return list(product(parts, parts))


def _planes(heights: Heights) -> Heights:
    """[2 R C, 3] of each cell's two triangles: height at the cell's first corner, rise along x and along y.

    MuJoCo cuts a cell from its first corner to the opposite one; the second triangle is that of larger x.
    """
    first, ahead = heights[:-1, :-1], heights[:-1, 1:]
    aside, opposite = heights[1:, :-1], heights[1:, 1:]
    upper = np.stack((first, opposite - aside, aside - first), axis=-1)
    lower = np.stack((first, ahead - first, opposite - ahead), axis=-1)
    return np.stack((upper, lower), axis=-2).reshape(-1, 3)
