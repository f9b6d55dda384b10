"""Heights of uneven ground, made tile by tile: slopes, rough ground, steps, stones, and what nobody can climb."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

TILE = 6.0
"""Edge of a tile [m] (AdaptNet's published code)."""
OBSTACLE_HEIGHT = 2.0
"""Height of an obstacle above the ground that it stands on [m]."""

_SLOPES = (-0.3, -0.2, 0.0, 0.2, 0.3)
_NOISE, _NOISE_STEP, _NOISE_SPACING = 0.1, 0.05, 0.2
_EDGE = 0.6
"""[m] No stone and no obstacle is nearer to its tile's edge, so that there is always a way between tiles."""

Heights = NDArray[np.float64]
Random = np.random.Generator


def slopes(x: Heights, y: Heights, random: Random) -> Heights:
    """A pyramid or a pit with a level middle of 1 m, of a slope of AdaptNet's published code; level at the edge."""
    return random.choice(_SLOPES) * np.minimum(_inside(x, y), 0.5 * TILE - 0.5)


def rough(x: Heights, y: Heights, random: Random) -> Heights:
    """Its published ground: such a pyramid, with up to 0.1 m in steps of 0.05 m at points 0.2 m apart, even between."""
    nodes = round(TILE / _NOISE_SPACING) + 1
    steps = round(_NOISE / _NOISE_STEP)
    noise = _NOISE_STEP * random.integers(-steps, steps + 1, (nodes, nodes))
    noise[[0, -1], :] = noise[:, [0, -1]] = 0.0
    at = np.linspace(0.0, TILE, nodes)
    along = np.stack([np.interp(x[0], at, row) for row in noise])
    return slopes(x, y, random) + np.stack([np.interp(y[:, 0], at, column) for column in along.T], axis=1)


def steps(x: Heights, y: Heights, random: Random) -> Heights:
    """Stairs around a level middle, up or down, of steps 0.05 to 0.15 m high and 0.5 to 0.8 m deep."""
    height, depth = random.choice((-1.0, 1.0)) * random.uniform(0.05, 0.15), random.uniform(0.5, 0.8)
    return height * np.floor(np.minimum(_inside(x, y), 0.5 * TILE - 0.5) / depth)


def stones(x: Heights, y: Heights, random: Random) -> Heights:
    """Level ground with twenty stones of 0.3 to 0.9 m and 0.05 to 0.2 m height."""
    ground = np.zeros_like(x)
    for _ in range(20):
        ground = np.maximum(ground, random.uniform(0.05, 0.2) * _block(x, y, 0.3, 0.9, random))
    return ground


def obstacle(x: Heights, y: Heights, random: Random) -> Heights:
    """A block of 0.5 to 1 m that nobody steps over; 1 where it stands, else 0."""
    return _block(x, y, 0.5, 1.0, random)


TILES: dict[str, Callable[[Heights, Heights, Random], Heights]] = {
    "slopes": slopes,
    "rough": rough,
    "steps": steps,
    "stones": stones,
}
"""Kinds of tiles: heights [R, C] [m] at points x, y [R, C] of a tile [m]; all are level at height 0 along its edge."""


def _inside(x: Heights, y: Heights) -> Heights:
    """Distance from the nearest edge of the tile [m]."""
    return np.minimum(np.minimum(x, TILE - x), np.minimum(y, TILE - y))


def _block(x: Heights, y: Heights, least: float, most: float, random: Random) -> Heights:
    """1 in a rectangle whose edges are of a length between these two [m], 0 around it."""
    wide, deep = random.uniform(least, most, 2)
    left, near = (random.uniform(_EDGE, TILE - _EDGE - edge) for edge in (wide, deep))
    return ((x >= left) & (x <= left + wide) & (y >= near) & (y <= near + deep)).astype(float)
