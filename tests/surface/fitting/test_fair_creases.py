"""Bends that no level can follow are smoothed within what the fit may miss its mesh by."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.fitting import deviation
from bonecam.surface.growth import Fit, least_radius, without_creases
from bonecam.surface.tspline import TSpline


@pytest.fixture(scope="module")
def mesh(pebble: Callable[..., TSpline]) -> TriangleMesh:
    return pebble().tessellate(0.01)


@pytest.fixture(scope="module")
def creased(pebble: Callable[..., TSpline], mesh: TriangleMesh) -> Fit:
    """A fit of the pebble three of whose rows crowd."""
    surface = pebble()
    points = surface.control_points.copy()
    starts = surface.tmesh.row_starts  # type: ignore[attr-defined]
    middle = len(starts) // 2
    below, row, above = (points[starts[j] : starts[j + 1]] for j in (middle - 1, middle, middle + 1))
    below += 0.97 * (row - below)
    above += 0.97 * (row - above)
    surface = surface.with_control_points(points)
    missed = deviation(surface, mesh)
    return Fit(surface, missed, 2.0 * missed.max, reached=True)


def test_the_least_radius_grows_and_the_surface_stays_within_the_limit(mesh: TriangleMesh, creased: Fit) -> None:
    sharpest = least_radius(creased.surface)
    assert sharpest < 0.3
    found = without_creases(creased, mesh, 0.3, creased.tolerance)
    assert found is not None
    assert least_radius(found.surface) > 1.5 * sharpest
    measured = deviation(found.surface, mesh)
    assert measured.max <= creased.tolerance
    assert found.deviation.max == pytest.approx(measured.max)
    assert found.reached


def test_a_surface_without_such_bends_and_one_that_would_leave_its_limit_stay(
    pebble: Callable[..., TSpline], mesh: TriangleMesh, creased: Fit
) -> None:
    round_one = replace(creased, surface=pebble())
    assert least_radius(round_one.surface) > 0.3
    assert without_creases(round_one, mesh, 0.3, 1.0) is None
    assert without_creases(creased, mesh, 0.3, 1e-4) is None


def test_the_radius_of_a_round_surface_is_that_of_its_narrowest_bend(pebble: Callable[..., TSpline]) -> None:
    surface = pebble()
    s, t = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, 40), np.linspace(0.02, 0.98, 60)))
    bends = surface.curvature(s, t)
    most = max(np.abs(bends.k1).max(), np.abs(bends.k2).max())
    assert least_radius(surface) == pytest.approx(1 / most, rel=0.3)
