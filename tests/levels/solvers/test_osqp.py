"""The quadratic program's answer obeys its rows, and contradictory rows are an error."""

import numpy as np
import pytest
import scipy.sparse as sp

from bonecam.errors import LevelError
from bonecam.levels.program import LinearLimits
from bonecam.levels.solvers.osqp import solve_qp


def rows(A: np.ndarray, low: list[float], high: list[float]) -> LinearLimits:
    return LinearLimits(sp.csr_array(A), np.array(low, dtype=float), np.array(high, dtype=float))


def test_the_answer_is_the_nearest_point_of_the_box() -> None:
    found = solve_qp(sp.csc_array(sp.eye_array(2)), np.array([-3.0, -0.25]), rows(np.eye(2), [0, 0], [1, 1]), 1e-6)
    assert np.allclose(found, [1, 0.25], atol=1e-4)
    assert ((found > -1e-4) & (found < 1 + 1e-4)).all()


BOX_AND_PLANE = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])


def test_all_rows_hold_together() -> None:
    limits = rows(BOX_AND_PLANE, [0, 0, -np.inf], [1, 1, 1])
    found = solve_qp(sp.csc_array(sp.eye_array(2)), np.array([-3.0, -3.0]), limits, 1e-6)
    assert np.allclose(found, [0.5, 0.5], atol=1e-4)


def test_contradicting_rows_are_an_error() -> None:
    limits = rows(BOX_AND_PLANE, [0, 0, 5], [1, 1, np.inf])
    with pytest.raises(LevelError, match="contradict"):
        solve_qp(sp.csc_array(sp.eye_array(2)), np.zeros(2), limits, 1e-6)
