"""Side steps of constant scallop height against circles in the plane.

Suresh & Yang, "Constant scallop-height machining of free-form surfaces", Journal of Engineering for Industry
116(2), 1994: the section across the feed is replaced by its circle of curvature, and the cusp lies on the
circles of two neighbouring balls. Gan et al. (2014), section 4.3 and Fig. 8, take their side step from there;
their section 5.1 gives the two pairs of ball radius and scallop height below. Here the cusp is found without
the formula: the two ball circles are placed by coordinates and intersected.
"""

import numpy as np
import pytest
from numpy import ndarray

from bonecam.job import FINISHING
from bonecam.job.tool_section import ROUGHING
from bonecam.planning.spacing import side_step

PUBLISHED = [(1.0, 0.01), (2.0, 0.05)]
"""Ball radius and scallop height (mm) of the finishing and the roughing levels in Gan et al., section 5.1."""
CURVATURES = [-0.45, -0.3, -0.1, -0.01, 0.01, 0.1, 0.25, 0.4, 1.0]
"""Curvatures of the section, 1/mm; positive where it bulges towards the cutter."""


def intersections(a: ndarray, b: ndarray, radius: float) -> ndarray:
    """The two points (2, 2) at which circles of one radius about `a` and `b` meet."""
    half = (b - a) / 2
    across = np.array([-half[1], half[0]]) / np.hypot(*half)
    away = np.sqrt(radius**2 - half @ half) * across
    return np.array([a + half + away, a + half - away])


def cusp_height(radius: float, step: float, curvature: float) -> float:
    """Height (mm) over the section of the cusp between balls whose contacts lie `step` apart along it."""
    if curvature == 0:
        centres = np.array([[0.0, radius], [step, radius]])
        return float(intersections(centres[0], centres[1], radius)[:, 1].min())

    section = 1 / abs(curvature)
    from_middle = section + np.sign(curvature) * radius
    angle = step * abs(curvature)
    centres = from_middle * np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])
    cusps = intersections(centres[0], centres[1], radius)
    return float(np.abs(np.linalg.norm(cusps, axis=1) - section).min())


def test_the_default_cutters_are_those_of_the_paper():
    assert [(tool.radius, tool.scallop) for tool in (FINISHING, ROUGHING)] == PUBLISHED


@pytest.mark.parametrize(("radius", "scallop"), PUBLISHED)
@pytest.mark.parametrize("curvature", [0.0, *CURVATURES])
def test_balls_a_side_step_apart_leave_exactly_the_scallop(radius, scallop, curvature):
    step = float(side_step(radius, scallop, np.array([curvature]))[0])
    assert cusp_height(radius, step, curvature) == pytest.approx(scallop, abs=1e-11)


@pytest.mark.parametrize(("radius", "scallop"), PUBLISHED)
def test_a_plane_takes_the_chord_of_the_ball_at_the_scallop(radius, scallop):
    """A plane at the scallop height cuts the ball in a circle, whose diameter the side step is."""
    chord = 2 * np.sqrt(radius**2 - (radius - scallop) ** 2)
    assert side_step(radius, scallop, np.zeros(1))[0] == pytest.approx(chord, rel=1e-14)


@pytest.mark.parametrize(("radius", "scallop"), PUBLISHED)
@pytest.mark.parametrize("curvature", [0.1, 0.25, 0.4, 1.0])
def test_the_approximation_of_textbooks_leaves_more_than_the_scallop(radius, scallop, curvature):
    step = np.sqrt(8 * scallop * radius / (1 + curvature * radius))
    assert cusp_height(radius, step, curvature) > scallop
