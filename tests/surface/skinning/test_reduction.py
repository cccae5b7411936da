"""Knot reduction: the bound holds everywhere, closed and open, alone and together; nothing needless is
kept."""

import numpy as np
import pytest

from bonecam.surface.basis import collocation, interpolate, sites
from bonecam.surface.skinning import Reduction


def wandering(count: int, closed: bool, seed: int = 3) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(count, 3)).cumsum(axis=0) * 0.1
    return points - closed * np.linspace(0, 1, count)[:, None] * (points[-1] - points[0])


@pytest.mark.parametrize("closed", [True, False])
def test_reduction_keeps_its_bound_everywhere(closed: bool) -> None:
    knots = np.arange(48) / 48 if closed else np.arange(1, 48) / 48
    points = wandering(48 if closed else 51, closed)
    kept, found = Reduction(knots, knots, closed).least_of_all([points], 0.2)[0]
    s = np.linspace(0, 1, 2000, endpoint=closed is False)
    assert len(found) < len(points)
    assert (
        np.linalg.norm(collocation(knots, s, closed) @ points - collocation(kept, s, closed) @ found, axis=1).max()
        < 0.2
    )
    if not closed:
        assert np.array_equal(found[[0, -1]], points[[0, -1]])


@pytest.mark.parametrize("closed", [True, False])
def test_a_curve_with_inserted_knots_gives_them_back(closed: bool) -> None:
    few, many = (np.array([0.05, 0.2, 0.5, 0.6, 0.9]), np.array([0.05, 0.1, 0.2, 0.3, 0.5, 0.55, 0.6, 0.75, 0.9, 0.95]))
    points = np.random.default_rng(4).normal(size=(len(sites(few, closed)), 3))
    at = sites(many, closed)
    fine = interpolate(many, at, collocation(few, at, closed) @ points, closed)
    kept, found = Reduction(many, many, closed).least_of_all([fine], 1e-9)[0]
    assert np.array_equal(kept, few)
    assert np.allclose(found, points, atol=1e-8)


def test_knots_for_curves_together_suffice_for_each() -> None:
    knots = np.arange(1, 40) / 40
    curves = [wandering(43, False, seed) for seed in (1, 2, 3)]
    reduction = Reduction(knots, knots, False)
    together = reduction.least_of_all([np.stack(curves, axis=1)], 0.2)[0][0]
    for curve in curves:
        assert len(reduction.least_of_all([curve], 0.2)[0][0]) <= len(together) < len(knots)


def test_a_tolerance_nothing_reaches_keeps_all_knots() -> None:
    knots = np.arange(20) / 20
    points = wandering(20, True)
    kept, found = Reduction(knots, knots, True).least_of_all([points], 1e-300)[0]
    assert np.array_equal(kept, knots)
    assert np.allclose(found, points, atol=1e-12)
