"""Heights of normal probes: above the surface what is left, below it how deep the ball went in."""

import numpy as np
import pytest
from numpy import ndarray

from bonecam.kernels.rays import Capsules, ProbesByCell, cut_normal_probes, probe_cells

RADIUS = 2.0
REACH = 0.3
X = np.array([1.0, 0.0, 0.0])


def height_after(centre: ndarray, from_top: bool = False, tall: float = REACH) -> float:
    """The height of a normal probe at the origin along X after a ball at the centre."""
    point, normal = np.zeros((1, 3)), X[None]
    _, starts, corner = probe_cells(point, 0.5)
    probes = ProbesByCell(point, normal, starts, corner, 0.5)
    balls = Capsules(centre[None], centre[None], np.full(1, RADIUS), names=np.zeros(1, dtype=int))
    heights = np.full(1, tall)
    cut_normal_probes(probes, REACH, balls, heights, np.full(1, -1), from_top=from_top)
    return float(heights[0])


@pytest.mark.parametrize("gouge", [-0.1, 0.003, 0.5, RADIUS])
def test_a_ball_from_outside_is_in_the_part_by_the_depth_of_its_lowest_point(gouge: float) -> None:
    assert height_after((RADIUS - gouge) * X) == pytest.approx(-gouge)


@pytest.mark.parametrize("out", [0.003, 0.5])
def test_a_ball_that_grazes_a_thin_edge_is_in_the_part_by_what_holds_the_point(out: float) -> None:
    """The chord was told before: 4 mm of a ball behind an edge, 0.2 mm of one that passes a tip at 0.003 mm."""
    assert height_after((out - RADIUS) * X) == pytest.approx(-out)
    assert height_after((RADIUS - out) * np.array([0.0, 1.0, 0.0])) == pytest.approx(-out)
    assert height_after(-1.01 * RADIUS * X) == REACH


def test_from_the_top_only_what_holds_the_upper_end_is_cut() -> None:
    below = np.array([RADIUS - 0.5, 0.0, 0.0])
    assert height_after(below, tall=4.0) == pytest.approx(-0.5)
    assert height_after(below, from_top=True, tall=4.0) == 4.0
    assert height_after(below, from_top=True, tall=3.0) == pytest.approx(-0.5)
