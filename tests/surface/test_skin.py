"""Skinning: ends met, sections met within the tolerance, smooth seam and poles, wrong input refused."""

import numpy as np
import pytest

from bonecam.surface.periodic import collocation, insertion, reduce
from bonecam.surface.skin import control_curves, row_parameters, skin

POLES = np.array([[0.0, 0.0, -3.0], [0.0, 0.0, 3.0]])


def ellipsoid_rows(rows: int = 9, points: int = 40) -> np.ndarray:
    t, s = np.meshgrid(np.pi * np.arange(1, rows + 1) / (rows + 1), 2 * np.pi * np.arange(points) / points, indexing="ij")
    return np.stack([2 * np.sin(t) * np.cos(s), np.sin(t) * np.sin(s) * (1 + 0.2 * np.cos(3 * s)), -3 * np.cos(t)], axis=2)


def test_the_surface_begins_and_ends_in_the_poles() -> None:
    surface = skin(ellipsoid_rows(), POLES, 0.01)
    s = np.linspace(0, 0.99, 12)
    for t, pole in ((0.0, POLES[0]), (1.0, POLES[1])):
        assert np.allclose(surface.evaluate(s, np.full(12, t)), pole, rtol=0, atol=1e-15 * 8)


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.001])
def test_every_section_first_and_last_too_is_met_within_the_tolerance(tolerance: float) -> None:
    points = ellipsoid_rows()
    exact, reduced = skin(points, POLES, 1e-12), skin(points, POLES, tolerance)
    t = row_parameters(points, POLES)[1:-1]
    s = np.linspace(0, 0.999, 57)
    ss, tt = (v.ravel() for v in np.meshgrid(s, t))
    assert np.linalg.norm(exact.evaluate(ss, tt) - reduced.evaluate(ss, tt), axis=1).max() < tolerance
    assert reduced.tmesh.size < exact.tmesh.size


def test_a_looser_tolerance_never_needs_more_control_points() -> None:
    sizes = [skin(ellipsoid_rows(), POLES, tolerance).tmesh.size for tolerance in (1e-3, 1e-2, 1e-1)]
    assert sizes == sorted(sizes, reverse=True)


def test_the_control_curves_interpolate_and_leave_the_poles_in_odd_directions() -> None:
    sections = np.concatenate([np.broadcast_to(POLES[0], (1, 40, 3)), ellipsoid_rows(), np.broadcast_to(POLES[1], (1, 40, 3))])
    t = row_parameters(ellipsoid_rows(), POLES)
    curves = control_curves(t, sections)
    assert np.allclose(curves[[0, -1]], sections[[0, -1]], atol=1e-12)
    arms = curves[1] - POLES[0]
    assert np.allclose(arms, -np.roll(arms, 20, axis=0), atol=1e-12)


def test_the_surface_is_c2_across_the_seam() -> None:
    surface = skin(ellipsoid_rows(), POLES, 0.01)
    t = np.linspace(0.1, 0.9, 9)
    before, after = surface.evaluate(np.full(9, 1 - 1e-9), t, 2), surface.evaluate(np.zeros(9), t, 2)
    for a, b in zip(before, after):
        assert np.allclose(a, b, atol=1e-4)


def test_reduction_keeps_its_bound_everywhere() -> None:
    knots = np.arange(48) / 48
    points = np.random.default_rng(3).normal(size=(48, 3)).cumsum(axis=0) * 0.1
    points -= np.linspace(0, 1, 48)[:, None] * (points[-1] - points[0])
    kept, found = reduce(knots, points, 0.2)
    s = np.linspace(0, 1, 2000, endpoint=False)
    assert len(kept) < 48
    assert np.linalg.norm(collocation(knots, s) @ points - collocation(kept, s) @ found, axis=1).max() < 0.2


def test_knot_insertion_leaves_a_curve_unchanged() -> None:
    coarse, fine = np.array([0, 0.2, 0.5, 0.6, 0.9]), np.array([0, 0.1, 0.2, 0.5, 0.55, 0.6, 0.9])
    points = np.random.default_rng(4).normal(size=(5, 3))
    s = np.linspace(0, 0.999, 101)
    assert np.allclose(collocation(coarse, s) @ points, collocation(fine, s) @ (insertion(coarse, fine) @ points), atol=1e-12)


def test_wrong_rows_are_refused() -> None:
    points = ellipsoid_rows()
    with pytest.raises(ValueError, match="two or more rows"):
        skin(points[:1], POLES, 0.1)
    with pytest.raises(ValueError, match="even number"):
        skin(points[:, :9], POLES, 0.1)
    with pytest.raises(ValueError, match="tolerance"):
        skin(points, POLES, 0.0)
    with pytest.raises(ValueError, match="coincide"):
        skin(np.concatenate([points[:1], points]), POLES, 0.1)
