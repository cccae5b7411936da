"""Curves of a cone on a surface of revolution."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.planning.axes.cones.cone import ObliqueEllipticCone, oblique_elliptic_cone
from bonecam.planning.axes.cones.intersection import intersect
from bonecam.surface.tspline import TSpline


@pytest.fixture
def surface(pebble: Callable[..., TSpline]) -> TSpline:
    return pebble()


def size_of(surface: TSpline) -> np.ndarray:
    return np.ptp(surface.control_points, axis=0)


def cone_at(surface: TSpline, place: tuple, towards: tuple, opening: float) -> ObliqueEllipticCone:
    """A round cone; lengths are shares of the surface's size from its middle."""
    size = size_of(surface)
    middle = (surface.control_points.max(0) + surface.control_points.min(0)) / 2
    axis = np.array(towards) * size
    side = np.cross(axis, [0.3, 1.0, 0.2])
    side *= opening * np.linalg.norm(axis) / np.linalg.norm(side)
    other = np.cross(axis, side) / np.linalg.norm(axis)
    return oblique_elliptic_cone(middle + np.array(place) * size, axis, (side, other))


def test_a_cone_about_the_axis_meets_the_surface_in_circles(surface: TSpline) -> None:
    cone = cone_at(surface, (0, 0, 1.0), (0, 0, -2.0), 0.08)
    curves = intersect(cone, surface, step=0.05 * size_of(surface)[0])
    assert len(curves) == 2
    for curve in curves:
        assert curve.closed
        assert np.ptp(curve.points[:, 2]) < 2e-2 * size_of(surface)[2]


@pytest.mark.parametrize("place", [(0.9, 0.1, 0.1), (0.3, 0.8, 0.4)])
def test_every_crossing_of_a_fine_mesh_lies_on_a_curve(surface: TSpline, place: tuple) -> None:
    size = float(size_of(surface)[0])
    cone = cone_at(surface, place, tuple(-2 * np.array(place)), 0.2)
    step = 0.02 * size
    curves = intersect(cone, surface, step=step, cells=48)
    points = np.vstack([curve.points for curve in curves])
    gradient = np.linalg.norm(cone.gradient(points), axis=1)
    assert (np.abs(cone.implicit(points)) / gradient).max() <= 1e-6
    for curve in curves:
        gaps = np.linalg.norm(np.diff(curve.points, axis=0), axis=1)
        assert gaps.max() < 1.1 * step

    mesh = surface.tessellate(0.002 * size)
    a, b = (mesh.vertices[mesh.faces[:, corner]] for corner in (0, 1))
    f, g = cone.implicit(a), cone.implicit(b)
    crossing = np.flatnonzero(f * g < 0)
    share = (f / (f - g))[crossing, None]
    met = a[crossing] + share * (b - a)[crossing]
    height = cone.heights(met)
    met = met[(height > 0.01) & (height < 0.99)]
    assert len(met) > 50
    gaps = np.linalg.norm(met[:, None] - points[None], axis=2).min(axis=1)
    assert gaps.max() < step


def test_a_cone_beside_the_surface_meets_nothing(surface: TSpline) -> None:
    assert intersect(cone_at(surface, (3.0, 0, 0), (1.0, 0, 0), 0.2), surface) == []


def test_steps_must_be_positive(surface: TSpline) -> None:
    with pytest.raises(ValueError, match="above 0"):
        intersect(cone_at(surface, (3.0, 0, 0), (1.0, 0, 0), 0.2), surface, step=0.0)
