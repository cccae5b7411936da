"""How far the new level is from the level before, and a level from the stock, seen from the bottoms of
hollows."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.levels.problem import ATTRACTIONS, discretise, remaining, whole
from bonecam.levels.program import reverse_depths
from bonecam.setup.capsule import Capsule
from bonecam.surface.tspline import TSpline


def test_what_a_filled_groove_leaves_behind_is_found_at_its_distance(grooved: Callable[[float], TSpline]) -> None:
    part, filled = grooved(0.4), grooved(1.0)
    rng = np.random.default_rng(1)
    s, t = rng.random(3000), rng.uniform(0.1, 0.9, 3000)
    x, y = part.positions(s, t), filled.positions(s, t)
    found = reverse_depths(filled, x, y, s, t, s, t, np.full(len(s), 0.3), 20)
    exact = filled.project(x).distances
    assert np.array_equal(found.which, np.flatnonzero(exact > 0.3))
    assert found.away == pytest.approx(exact[found.which], abs=1e-6)
    assert np.allclose(x[found.which] + found.away[:, None] * found.n, filled.positions(found.s, found.t))
    assert np.abs(np.mod(s[found.which] + 0.5, 1) - 0.5).max() < 0.15


def test_of_a_groove_more_is_left_from_its_bottom_than_from_the_stock(
    capsule: Capsule, grooved: Callable[[float], TSpline]
) -> None:
    discretisation = discretise(grooved(0.4), capsule, ATTRACTIONS["stock"])
    rest = remaining(discretisation, discretisation.surface.control_points, whole(capsule))
    assert rest.farthest < rest.left == rest.depth
    assert -capsule.signed_distance(rest.place[None])[0] == pytest.approx(rest.depth)
    assert np.hypot(*rest.place[:2]) < 2.5
