"""Paths on the ground: points at even distances, joined by straight lines, going straight on after the last."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

SPACING = 0.1
"""Greatest distance along a path between two of its points [m]."""

_SPLINE_SAMPLES = 64


@dataclass(frozen=True)
class Paths:
    """N paths of equally many points.

    Attributes:
        points: [N, P, 2] [m].
        spacing: length of path between two neighbouring points [m].
    """

    points: Tensor
    spacing: float

    def at(self, arc: Tensor) -> Tensor:
        """The points [N, K, 2] that lie at these lengths arc [N, K] of path [m]."""
        share = arc / self.spacing
        first = share.floor().long().clamp(0, self.points.shape[1] - 2)
        start, end = self._rows(first), self._rows(first + 1)
        return start + (share - first).unsqueeze(-1) * (end - start)

    def nearest(self, arc: Tensor, point: Tensor, ahead: float) -> tuple[Tensor, Tensor]:
        """The places of the paths nearest to point [N, 2], among those from `arc` [N] to about `ahead` further on [m].

        Returns:
            arc [N] of that place [m]; its distance [N] from the point [m].
        """
        last = self.points.shape[1] - 2
        segments = torch.arange(math.ceil(ahead / self.spacing) + 1)
        first = (arc / self.spacing).floor().long().clamp_max(last).unsqueeze(-1) + segments
        first = first.clamp_max(last)
        start, end = self._rows(first), self._rows(first + 1)
        along = end - start
        share = ((point.unsqueeze(1) - start) * along).sum(-1) / along.square().sum(-1).clamp_min(1e-12)
        share = torch.where(first == last, share, share.clamp_max(1.0))  # the last line has no end
        share = torch.maximum(share, arc.unsqueeze(-1) / self.spacing - first).clamp_min(0.0)
        distance = (start + share.unsqueeze(-1) * along - point.unsqueeze(1)).norm(dim=-1)
        best = distance.argmin(dim=-1, keepdim=True)
        return (first + share).gather(1, best).squeeze(-1) * self.spacing, distance.gather(1, best).squeeze(-1)

    def _rows(self, index: Tensor) -> Tensor:
        """[N, K, 2] points of these indices [N, K]."""
        return self.points.gather(1, index.unsqueeze(-1).expand(-1, -1, 2))


def random_paths(n: int, length: float, bend_radius: float, bend_length: float, generator: torch.Generator) -> Paths:
    """Smooth paths from the origin along x.

    Their curvature is drawn anew every `bend_length` [m], even between a left and a right bend of `bend_radius` [m],
    and changes evenly in between.
    """
    count = math.ceil(length / SPACING)
    spacing = length / count
    knots = math.ceil(length / bend_length) + 1
    drawn = (2.0 * torch.rand(n, knots, generator=generator, dtype=torch.float64) - 1.0) / bend_radius
    share = (torch.arange(count - 1) + 1.0).double() * spacing / bend_length
    knot = share.floor().long().clamp_max(knots - 2)
    curvature = torch.lerp(drawn[:, knot], drawn[:, knot + 1], share - knot)
    angle = torch.cat((torch.zeros(n, 1, dtype=torch.float64), curvature * spacing), dim=1).cumsum(1)
    steps = spacing * torch.stack((angle.cos(), angle.sin()), dim=-1)
    return Paths(torch.cat((torch.zeros(n, 1, 2, dtype=torch.float64), steps), dim=1).cumsum(1), spacing)


def path_through(points: np.ndarray, spline: bool) -> Paths:
    """One path along these points [K, 2]: straight from one to the next, or by a Catmull-Rom spline."""
    if spline:
        points = _catmull_rom(points)
    length = np.concatenate(([0.0], np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum()))
    count = math.ceil(length[-1] / SPACING)
    arc = np.linspace(0.0, length[-1], count + 1)
    even = np.stack([np.interp(arc, length, column) for column in points.T], axis=-1)
    return Paths(torch.from_numpy(even).unsqueeze(0), length[-1] / count)


def _catmull_rom(points: np.ndarray) -> np.ndarray:
    """[(K - 1) * samples + 1, 2] of the cubics whose tangents are half the way from the point before to that after."""
    tangent = np.gradient(points, axis=0)
    t = (np.arange(_SPLINE_SAMPLES) / _SPLINE_SAMPLES)[:, None]
    pieces = [
        (2 * t**3 - 3 * t**2 + 1) * a + (t**3 - 2 * t**2 + t) * u + (3 * t**2 - 2 * t**3) * b + (t**3 - t**2) * v
        for a, b, u, v in zip(points[:-1], points[1:], tangent[:-1], tangent[1:], strict=True)
    ]
    return np.concatenate([*pieces, points[-1:]])
