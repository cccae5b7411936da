"""The T-mesh of the levels: as fine as the cuts ask for, the surface unchanged."""

import numpy as np
import pytest

from bonecam.levels import refine_for_depth as module
from bonecam.levels.problem.discretisation import Discretisation
from bonecam.levels.refine_for_depth import refine_for_depth
from bonecam.setup.capsule import Capsule
from bonecam.setup.stocks.box import Box

RNG = np.random.default_rng(7)


def test_the_surface_is_the_same_with_more_control_points(
    discretisation: Discretisation, capsule: Capsule
) -> None:
    part = discretisation.surface
    found = refine_for_depth(part, capsule, 0.1)
    assert part.tmesh.size < found.tmesh.size <= module.IN_CAPSULES[2]
    s, t = RNG.random((2, 500))
    assert np.abs(found.positions(s, t) - part.positions(s, t)).max() < 1e-12
    assert found.poles == part.poles


def test_a_surface_that_is_fine_enough_stays_as_it_is(
    discretisation: Discretisation, capsule: Capsule
) -> None:
    part = discretisation.surface
    assert refine_for_depth(part, capsule, 100.0).tmesh.size == part.tmesh.size


def test_no_more_control_points_than_allowed(
    discretisation: Discretisation, capsule: Capsule, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = discretisation.surface
    most = part.tmesh.size + 20
    monkeypatch.setattr(module, "IN_CAPSULES", (14.0, most, most))
    assert refine_for_depth(part, capsule, 0.05).tmesh.size <= most


def test_a_surface_of_many_control_points_stays_as_it_is(
    discretisation: Discretisation, capsule: Capsule, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = discretisation.surface
    monkeypatch.setattr(module, "IN_CAPSULES", (14.0, part.tmesh.size, 3000))
    assert refine_for_depth(part, capsule, 0.05) is part


def test_spans_are_shorter_in_a_stock_with_flats(discretisation: Discretisation, capsule: Capsule) -> None:
    part, (low, high) = discretisation.surface, np.array([[-4.5, -4.5, 0.0], [4.5, 4.5, 20.0]])
    assert (
        refine_for_depth(part, Box(low, high).round_edges(3.0), 0.3).tmesh.size
        > 1.3 * refine_for_depth(part, capsule, 0.3).tmesh.size
    )


def test_spans_across_the_stocks_axis_are_not_halved_for_ever(
    discretisation: Discretisation, capsule: Capsule
) -> None:
    """The nearest points of a short line across the axis lie a stock's diameter apart: that alone would
    double the control points."""
    part = discretisation.surface
    aside = capsule.move(np.array([np.ptp(part.control_points[:, 0]) / 2, 0.0, 0.0]))
    assert refine_for_depth(part, aside, 0.2).tmesh.size < 1.5 * part.tmesh.size
