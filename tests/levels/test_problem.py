"""Banded matrices are factorised, alone or with weighed rows.

Products of the basis at samples with points.

How far the new level is from the level before, and a level from the stock, seen from the bottoms of
hollows.
"""

import numpy as np
import pytest
import scipy.sparse as sp
from level_parts import CAPSULE, grooved

from bonecam.errors import LevelError
from bonecam.kernels.matrices import transposed_times
from bonecam.levels.problem import ATTRACTIONS, discretise, factorise, multiply, remaining, whole
from bonecam.levels.program import reverse_depths


def test_a_band_that_is_not_definite_is_an_error():
    with pytest.raises(LevelError, match="control points"):
        factorise(sp.csc_array(np.diag([1.0, 0.0, 1.0])))


def test_rows_times_points_and_back_are_scipys():
    rng = np.random.default_rng(2)
    R = sp.random_array((300, 40), density=0.2, format="csr", rng=rng)
    points, y, D = rng.random((40, 3)), rng.random((300, 3)), np.full((40, 3), np.nan)
    assert np.allclose(multiply(R, points), R @ points, atol=1e-14)
    assert np.array_equal(multiply(R, np.asfortranarray(points)), multiply(R, points))
    transposed_times(R.indptr, R.indices, R.data, y, D)
    assert np.allclose(D, R.T @ y, atol=1e-13)


def test_what_a_filled_groove_leaves_behind_is_found_at_its_distance():
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


def test_of_a_groove_more_is_left_from_its_bottom_than_from_the_stock():
    discretisation = discretise(grooved(0.4), CAPSULE, ATTRACTIONS["stock"])
    rest = remaining(discretisation, discretisation.surface.control_points, whole(CAPSULE))
    assert rest.farthest < rest.left == rest.depth
    assert -CAPSULE.signed_distance(rest.place[None])[0] == pytest.approx(rest.depth)
    assert np.hypot(*rest.place[:2]) < 2.5
