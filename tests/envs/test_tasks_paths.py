"""Paths on the ground."""

import numpy as np
import pytest
import torch

from murmillo.envs.tasks.paths import path_through, random_paths

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]])


def at(path, *arcs: float) -> list[list[float]]:
    return path.at(torch.tensor([arcs], dtype=torch.float64))[0].tolist()


def nearest(path, arc: float, point: tuple[float, float], ahead: float = 0.5) -> tuple[float, float]:
    found = path.nearest(torch.tensor([arc]).double(), torch.tensor([point]).double(), ahead)
    return found[0].item(), found[1].item()


def test_a_polyline_keeps_its_corners_and_goes_straight_on():
    path = path_through(SQUARE, spline=False)
    assert at(path, 0.0, 1.23, 2.0, 3.5) == [pytest.approx(p) for p in ([0, 0], [1.23, 0], [2, 0], [2, 1.5])]
    assert at(path, 6.0)[0] == pytest.approx([2.0, 4.0])


def test_a_spline_goes_through_its_points_without_corners():
    points = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [5.0, 3.0]])
    path = path_through(points, spline=True)
    even = path.points[0].numpy()
    assert max(np.linalg.norm(even - point, axis=1).min() for point in points) < 0.05
    steps = np.diff(even, axis=0)
    assert np.linalg.norm(steps, axis=1) == pytest.approx(path.spacing, rel=0.01)
    angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    assert np.abs(np.diff(angle)).max() < 0.5  # the polyline turns by 1.57


def test_random_paths_begin_ahead_are_even_and_bend_no_tighter_than_asked():
    paths = random_paths(200, 30.0, 4.0, 3.0, torch.Generator().manual_seed(0))
    steps = paths.points.diff(dim=1)
    assert not paths.points[:, 0].any()
    assert steps[:, 0, 1].abs().max() < 1e-12
    assert (steps.norm(dim=-1) - paths.spacing).abs().max() < 1e-12
    assert steps.shape[1] * paths.spacing == pytest.approx(30.0)
    angle = torch.atan2(steps[..., 1], steps[..., 0])
    turn = (angle.diff(dim=1) + torch.pi) % (2 * torch.pi) - torch.pi
    curvature = turn / paths.spacing
    assert 0.9 / 4.0 < curvature.abs().max() <= 1.0 / 4.0 + 1e-9
    assert curvature.mean().abs() < 0.01
    assert curvature.diff(dim=1).abs().max() <= 2.0 / 4.0 / 3.0 * paths.spacing + 1e-9  # smooth


def test_the_nearest_place_lies_ahead_and_near():
    path = path_through(SQUARE, spline=False)
    assert nearest(path, 0.0, (0.3, 0.4)) == pytest.approx((0.3, 0.4))
    assert nearest(path, 0.55, (0.3, 0.0)) == pytest.approx((0.55, 0.25))  # never back
    assert nearest(path, 1.8, (2.1, 0.15)) == pytest.approx((2.15, 0.1))  # round the corner
    assert nearest(path, 0.0, (2.0, 1.0))[0] <= 0.7  # no jump to the other side of a bend
    assert nearest(path, 4.0, (2.5, 9.0)) == pytest.approx((11.0, 0.5))  # after the end


def test_a_path_there_and_back_can_be_followed():
    path = path_through(np.array([[0.0, 0.0], [1.03, 0.0], [0.0, 0.0]]), spline=False)
    arc = 0.0
    for x in [*np.arange(0.0, 1.0, 0.1), *np.arange(1.0, 0.0, -0.1)]:
        arc, distance = nearest(path, arc, (x, 0.0))
        assert distance < 0.05
    assert arc > 1.9
