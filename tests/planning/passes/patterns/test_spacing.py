"""Line positions: increasing, within the domain, and finite also where a level has a crease."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.planning.spacing import across_feed, line_positions, needed_ranges, side_step
from bonecam.surface.tspline import TSpline


@pytest.mark.parametrize("pattern", ["round", "along"])
@pytest.mark.parametrize("radius", [1.0, 2.0])
def test_lines_increase_within_the_domain(grooved_pebble: Callable[..., TSpline], pattern: str, radius: float) -> None:
    lines = line_positions(grooved_pebble(1.0), pattern, radius, 0.02)
    assert (np.diff(lines) > 0).all()
    assert 0 <= lines[0] < lines[-1] < 1


@pytest.mark.parametrize("pattern", ["round", "along"])
def test_a_crease_does_not_crowd_lines_without_end(pebble: Callable[..., TSpline], pattern: str) -> None:
    smooth = pebble()
    points = np.array(smooth.control_points)
    points[25:29] = points[25]
    points[37:41] = points[25]
    points[49:53] = points[25]
    creased = TSpline(smooth.tmesh, points, smooth.weights)
    assert len(line_positions(creased, pattern, 2.0, 0.05)) < 6 * len(line_positions(smooth, pattern, 2.0, 0.05))


def test_a_smaller_scallop_takes_more_lines_by_its_root(pebble: Callable[..., TSpline]) -> None:
    counts = [len(line_positions(pebble(), "round", 1.0, scallop)) for scallop in (0.04, 0.01)]
    assert counts[1] / counts[0] == pytest.approx(2.0, rel=0.1)


def test_a_pattern_that_is_not_resolved_is_refused(pebble: Callable[..., TSpline]) -> None:
    with pytest.raises(ValueError, match="'fastest'"):
        line_positions(pebble(), "fastest", 1.0, 0.01)


@pytest.mark.parametrize("radius", [1.0, 2.0])
def test_no_more_than_a_pass_lies_between_lines_where_they_are_needed(
    grooved_pebble: Callable[..., TSpline], radius: float
) -> None:
    """And near the poles far fewer lines are left."""
    surface, scallop = grooved_pebble(1.0), 0.02
    across = line_positions(surface, "along", radius, scallop)
    first, last = needed_ranges(surface, across, radius, scallop).T
    for t in np.linspace(0.02, 0.98, 25):
        s = across[(first <= t) & (t <= last)]
        s = np.r_[s, s[0] + 1.0]
        fine = np.linspace(s[0], s[-1], 4001)
        height, curvature = across_feed(surface, "along", np.mod(fine, 1.0), np.full(len(fine), t))
        rate = height / side_step(radius, scallop, np.where(1 + curvature * radius > 0.05, curvature, 0.0))
        counts = np.interp(s, fine, np.r_[0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(fine))])
        assert np.diff(counts).max() <= 1.0
    assert np.count_nonzero(first < 0.008) < 0.3 * len(across)
