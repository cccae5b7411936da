"""Side step and scallop against plain circle and line sections.

Line positions: increasing, within the domain, and finite also where a level has a crease.
"""

import numpy as np
import pytest
from small_parts import grooved_pebble, pebble

from bonecam.errors import ToolPathError
from bonecam.planning.spacing import across_feed, line_positions, needed_ranges, side_step
from bonecam.surface.tspline import TSpline


def cusp_by_geometry(radius: float, step: float, curvature: float) -> float:
    """Height of the intersection of two neighbouring balls above the section, from coordinates alone."""
    if curvature == 0:
        return radius - np.sqrt(radius**2 - (step / 2) ** 2)
    rho = 1 / curvature
    angle = step / rho
    centre = (rho + radius) * np.array([np.sin(angle / 2), np.cos(angle / 2)])
    heights = np.linspace(-0.01 * radius, 0.5 * radius, 2_000_001)
    return float(heights[np.argmax(np.hypot(centre[0], centre[1] - (rho + heights)) <= radius)])


@pytest.mark.parametrize(
    ("radius", "scallop", "curvature"),
    [
        (1.0, 0.01, 0.0),
        (1.0, 0.01, 0.25),
        (2.0, 0.05, -0.3),
        (3.0, 0.1, 0.1),
        (0.5, 0.005, -1.8),
        (2.0, 0.05, -1e-5),
        (2.0, 0.05, 1e-7),
    ],
)
def test_two_balls_a_side_step_apart_leave_exactly_the_scallop(radius, scallop, curvature):
    step = float(side_step(radius, scallop, np.array([curvature]))[0])
    assert cusp_by_geometry(radius, step, curvature) == pytest.approx(scallop, abs=2e-6 * radius)


def test_a_section_sharper_than_the_ball_is_refused():
    with pytest.raises(ToolPathError, match="gouges") as caught:
        side_step(1.0, 0.01, np.array([0.2, -1.0]))
    assert caught.value.evidence["index"] == 1


def test_scallop_outside_the_ball_is_a_wrong_call():
    with pytest.raises(ValueError, match="scallop"):
        side_step(1.0, 0.0, np.zeros(1))


@pytest.mark.parametrize("pattern", ["round", "along"])
def test_a_crease_does_not_crowd_lines_without_end(pattern):
    smooth = pebble()
    points = np.array(smooth.control_points)
    points[25:29] = points[25]
    points[37:41] = points[25]
    points[49:53] = points[25]
    creased = TSpline(smooth.tmesh, points, smooth.weights)
    assert len(line_positions(creased, pattern, 2.0, 0.05)) < 6 * len(line_positions(smooth, pattern, 2.0, 0.05))


def test_a_pattern_that_is_not_resolved_is_refused():
    with pytest.raises(ValueError, match="'fastest'"):
        line_positions(pebble(), "fastest", 1.0, 0.01)


@pytest.mark.parametrize("radius", [1.0, 2.0])
def test_no_more_than_a_pass_lies_between_lines_where_they_are_needed(radius):
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
