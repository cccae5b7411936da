"""The T-mesh of the levels: as fine as the cuts ask for, the surface unchanged."""

from collections.abc import Callable

import numpy as np

from bonecam.levels.closed_morph import refine_for_depth
from bonecam.levels.problem import Discretisation
from bonecam.setup.capsule import Capsule
from bonecam.setup.stocks.box import Box
from bonecam.surface.tspline import TSpline

RNG = np.random.default_rng(7)
MANY_IN_CAPSULES, MOST_IN_CAPSULES = 800, 3000
"""A surface of so many control points is left alone; one of fewer gets at most so many."""
MOST_WITH_FLATS = 1000
"""Control points at most in a stock with flat faces."""


def box() -> Box:
    return Box(np.array([-4.5, -4.5, 0.0]), np.array([4.5, 4.5, 20.0]))


def test_the_surface_is_the_same_with_more_control_points(discretisation: Discretisation, capsule: Capsule) -> None:
    part = discretisation.surface
    found = refine_for_depth(part, capsule, 0.1)
    assert part.tmesh.size < found.tmesh.size <= MOST_IN_CAPSULES
    s, t = RNG.random((2, 500))
    assert np.abs(found.positions(s, t) - part.positions(s, t)).max() < 1e-12
    assert found.poles == part.poles


def test_a_surface_that_is_fine_enough_stays_as_it_is(discretisation: Discretisation, capsule: Capsule) -> None:
    part = discretisation.surface
    assert refine_for_depth(part, capsule, 100.0).tmesh.size == part.tmesh.size


def test_no_more_control_points_than_allowed(discretisation: Discretisation, capsule: Capsule) -> None:
    """Spans stay longer than cuts so shallow ask for."""
    part = discretisation.surface
    cases = ((capsule, 0.04, MOST_IN_CAPSULES), (box().round_edges(3.0), 0.1, MOST_WITH_FLATS))
    for stock, depth, most in cases:
        assert part.tmesh.size < refine_for_depth(part, stock, depth).tmesh.size <= most


def test_a_surface_of_many_control_points_stays_as_it_is(waisted: Callable[..., TSpline], capsule: Capsule) -> None:
    many, fewer = waisted(rows=30, around=32), waisted(rows=22, around=32)
    assert fewer.tmesh.size < MANY_IN_CAPSULES <= many.tmesh.size
    assert refine_for_depth(many, capsule, 0.05) is many
    assert refine_for_depth(fewer, capsule, 0.05).tmesh.size > fewer.tmesh.size


def test_spans_are_shorter_in_a_stock_with_flats(discretisation: Discretisation, capsule: Capsule) -> None:
    part = discretisation.surface
    assert (
        refine_for_depth(part, box().round_edges(3.0), 0.3).tmesh.size
        > 1.3 * refine_for_depth(part, capsule, 0.3).tmesh.size
    )


def test_spans_across_the_stocks_axis_are_not_halved_for_ever(discretisation: Discretisation, capsule: Capsule) -> None:
    """The nearest points of a short line across the axis lie a stock's diameter apart: that alone would
    double the control points."""
    part = discretisation.surface
    aside = capsule.move(np.array([np.ptp(part.control_points[:, 0]) / 2, 0.0, 0.0]))
    assert refine_for_depth(part, aside, 0.2).tmesh.size < 1.5 * part.tmesh.size
