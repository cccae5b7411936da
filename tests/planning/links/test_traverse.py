"""Traverses round the stock: off its surface all along, within the limits, in small steps."""

from itertools import pairwise

import numpy as np
import pytest

from bonecam.arrays import angles_between, unit
from bonecam.machine.limits import MachineLimits
from bonecam.planning.link_space import MAX_TURN, ClearanceSurface, TraverseOptions, traverse
from bonecam.setup.capsule import Capsule

STOCK = Capsule(np.array([1.0, -2.0, 45.0]), np.array([1.0, -2.0, 60.0]), 6.0)
SURFACE = ClearanceSurface(STOCK, 4.0)
LIMITS = MachineLimits(np.radians(115.0))


def pose(direction: list[float], height: float) -> tuple[np.ndarray, np.ndarray]:
    """Where a ball that left along `direction` crosses the clearance surface."""
    axis = unit(np.array([direction], dtype=np.float64))[0]
    start = np.array([1.0, -2.0, height])
    return start + SURFACE.exit_lengths(start[None], axis[None])[0] * axis, axis


ENDS = [
    (pose([1, 0, 0], 50), pose([-1, 0.1, 0], 55)),
    (pose([1, 0, -0.4], 46), pose([0, 1, 0.5], 60)),
    (pose([0.3, 0, 1], 58), pose([0, -1, -0.4], 45)),
]
OPTIONS = [
    TraverseOptions(),
    TraverseOptions(long_way=True),
    TraverseOptions(rise=5.0),
    TraverseOptions(over_pole=True),
]


@pytest.mark.parametrize("case", range(len(ENDS)))
@pytest.mark.parametrize("options", OPTIONS)
def test_the_ball_stays_outside_and_the_axis_within_limits(case: int, options: TraverseOptions) -> None:
    first, last = ENDS[case]
    centres, axes = traverse(SURFACE, first, last, LIMITS, options)
    assert np.allclose(centres[[0, -1]], [first[0], last[0]])
    assert np.allclose(axes[[0, -1]], [first[1], last[1]])
    fine = np.vstack([np.linspace(a, b, 9) for a, b in pairwise(centres)])
    assert STOCK.signed_distance(fine).min() > 4.0 - 0.2
    assert LIMITS.allow(axes).all()
    assert angles_between(axes[1:], axes[:-1]).max() < 2.5 * MAX_TURN


def test_the_exit_lies_on_the_surface() -> None:
    for end in (end for pair in ENDS for end in pair):
        assert STOCK.signed_distance(end[0][None])[0] == pytest.approx(4.0, abs=1e-9)


def test_coordinates_lead_back_to_their_points() -> None:
    rng = np.random.default_rng(1)
    for point in np.array([1.0, -2.0, 52.0]) + rng.normal(size=(40, 3)) * 30:
        azimuth, arc, height = SURFACE.coordinates(point)
        found, frames = SURFACE.frames(np.array([azimuth]), np.array([arc]), np.array([height]))
        assert np.allclose(found[0], point)
        assert np.allclose(frames[0].T @ frames[0], np.eye(3))
