"""Products of the basis at samples with points."""

import numpy as np
import scipy.sparse as sp

from bonecam.kernels.matrices import transposed_times
from bonecam.levels.problem import multiply


def test_rows_times_points_and_back_are_scipys() -> None:
    rng = np.random.default_rng(2)
    R = sp.random_array((300, 40), density=0.2, format="csr", rng=rng)
    points, y, D = rng.random((40, 3)), rng.random((300, 3)), np.full((40, 3), np.nan)
    assert np.allclose(multiply(R, points), R @ points, atol=1e-14)
    assert np.array_equal(multiply(R, np.asfortranarray(points)), multiply(R, points))
    transposed_times(R.indptr, R.indices, R.data, y, D)
    assert np.allclose(D, R.T @ y, atol=1e-13)
