"""What a picture shows of a goal: balls and arrows that are not part of the simulation."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np


@dataclass(frozen=True)
class Marker:
    """A coloured ball or arrow in a picture, which touches nothing.

    Attributes:
        pos_w: its place [m], three numbers.
        direction_w: of an arrow, three numbers; None makes a ball.
        size: radius of the ball, length of the arrow [m].
        rgba: four numbers from 0 to 1.
    """

    pos_w: Sequence[float]
    direction_w: Sequence[float] | None = None
    size: float = 0.1
    rgba: tuple[float, float, float, float] = (0.85, 0.2, 0.15, 0.8)


def draw_markers(scene: mujoco.MjvScene, markers: Sequence[Marker]) -> None:
    """Add the markers to a scene that is about to be drawn; those beyond its room are left out."""
    for marker in markers[: scene.maxgeom - scene.ngeom]:
        geom = scene.geoms[scene.ngeom]
        ball = marker.direction_w is None
        kind = mujoco.mjtGeom.mjGEOM_SPHERE if ball else mujoco.mjtGeom.mjGEOM_ARROW
        size, pos = np.full(3, marker.size), np.asarray(marker.pos_w, dtype=np.float64)
        mujoco.mjv_initGeom(geom, kind, size, pos, np.eye(3).flatten(), np.asarray(marker.rgba, dtype=np.float32))
        if marker.direction_w is not None:
            direction = np.asarray(marker.direction_w, dtype=np.float64)
            end = pos + marker.size * direction / max(float(np.linalg.norm(direction)), 1e-9)
            mujoco.mjv_connector(geom, kind, 0.05 * marker.size, pos, end)
        scene.ngeom += 1
