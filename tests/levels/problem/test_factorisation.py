"""Banded matrices are factorised, alone or with weighed rows."""

import numpy as np
import pytest
import scipy.sparse as sp

from bonecam.errors import LevelError
from bonecam.levels.problem import factorise


def test_a_factored_band_solves() -> None:
    rng = np.random.default_rng(1)
    R = sp.csr_array(sp.diags_array(rng.random((3, 40)), offsets=[0, -2, -5], shape=(46, 40)))
    matrix, b = sp.csc_array(R.T @ R), rng.random((40, 3))
    assert np.allclose(matrix @ factorise(matrix).solve(b), b)


def test_a_band_that_is_not_definite_is_an_error() -> None:
    with pytest.raises(LevelError, match="control points"):
        factorise(sp.csc_array(np.diag([1.0, 0.0, 1.0])))


def test_rows_that_are_weighed_are_added_to_the_band() -> None:
    rng = np.random.default_rng(1)
    R, weights, b = (
        sp.csr_array(sp.diags_array(rng.random((3, 40)), offsets=[0, -2, -5], shape=(46, 40))),
        rng.random(46),
        rng.random((40, 3)),
    )
    matrix = sp.csc_array(sp.eye_array(40))
    found = factorise(matrix, R, weights).solve(b)
    assert np.allclose(R.T @ (weights[:, None] * (R @ found)) + found, b)
