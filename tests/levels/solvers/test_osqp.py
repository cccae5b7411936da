"""The quadratic program's answer obeys its rows, and contradictory rows are an error."""

import numpy as np
import pytest
import scipy.sparse as sp

from bonecam.errors import LevelError
from bonecam.kernels.rows import transposed_times
from bonecam.levels.problem.samples import combined
from bonecam.levels.solvers.osqp import Rows, factor, solve, stacked


def rows(A: np.ndarray, low: list[float], high: list[float]) -> Rows:
    return Rows(sp.csr_array(A), np.array(low, dtype=float), np.array(high, dtype=float))


def test_the_answer_is_the_nearest_point_of_the_box() -> None:
    found = solve(
        sp.csc_array(sp.eye_array(2)), np.array([-3.0, -0.25]), rows(np.eye(2), [0, 0], [1, 1]), 1e-6
    )
    assert np.allclose(found.x, [1, 0.25], atol=1e-4)
    assert found.violation < 1e-4


def test_stacked_rows_hold_together() -> None:
    box, plane = rows(np.eye(2), [0, 0], [1, 1]), rows(np.array([[1.0, 1.0]]), [-np.inf], [1.0])
    found = solve(sp.csc_array(sp.eye_array(2)), np.array([-3.0, -3.0]), stacked(box, plane), 1e-6)
    assert np.allclose(found.x, [0.5, 0.5], atol=1e-4)


def test_contradicting_rows_are_an_error() -> None:
    box, plane = rows(np.eye(2), [0, 0], [1, 1]), rows(np.array([[1.0, 1.0]]), [5.0], [np.inf])
    with pytest.raises(LevelError, match="contradict"):
        solve(sp.csc_array(sp.eye_array(2)), np.zeros(2), stacked(box, plane), 1e-6)


def test_a_factored_band_solves() -> None:
    rng = np.random.default_rng(1)
    R = sp.csr_array(sp.diags_array(rng.random((3, 40)), offsets=[0, -2, -5], shape=(46, 40)))
    matrix, b = sp.csc_array(R.T @ R), rng.random((40, 3))
    assert np.allclose(matrix @ factor(matrix).solve(b), b)


def test_a_band_that_is_not_definite_is_an_error() -> None:
    with pytest.raises(LevelError, match="control points"):
        factor(sp.csc_array(np.diag([1.0, 0.0, 1.0])))


def test_rows_that_are_weighed_are_added_to_the_band() -> None:
    rng = np.random.default_rng(1)
    R, weights, b = (
        sp.csr_array(sp.diags_array(rng.random((3, 40)), offsets=[0, -2, -5], shape=(46, 40))),
        rng.random(46),
        rng.random((40, 3)),
    )
    matrix = sp.csc_array(sp.eye_array(40))
    found = factor(matrix, R, weights).solve(b)
    assert np.allclose(R.T @ (weights[:, None] * (R @ found)) + found, b)


def test_rows_times_points_and_back_are_scipys() -> None:
    rng = np.random.default_rng(2)
    R = sp.random_array((300, 40), density=0.2, format="csr", rng=rng)
    points, y, D = rng.random((40, 3)), rng.random((300, 3)), np.full((40, 3), np.nan)
    assert np.allclose(combined(R, points), R @ points, atol=1e-14)
    assert np.array_equal(combined(R, np.asfortranarray(points)), combined(R, points))
    transposed_times(R.indptr, R.indices, R.data, y, D)
    assert np.allclose(D, R.T @ y, atol=1e-13)
