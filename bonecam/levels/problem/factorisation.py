"""Cholesky factors of banded matrices over the control points of a surface."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.linalg.lapack import dpbtrf, dpbtrs

from bonecam.errors import LevelError
from bonecam.kernels import normal_equations as kernel


@dataclass(frozen=True, eq=False)
class BandedCholesky:
    """The Cholesky factor L of a banded matrix A = L L': its `lower` diagonals, the main one first."""

    lower: Float[ndarray, "d m"]

    def solve(self, b: Float[ndarray, "m 3"]) -> Float[ndarray, "m 3"]:
        """x of A x = b, for three right sides."""
        return dpbtrs(self.lower, b, lower=True)[0]


def factorise(
    matrix: sp.csc_array, R: sp.csr_array | None = None, weights: Float[ndarray, " k"] | None = None
) -> BandedCholesky:
    """The factor of `matrix` (m, m), or of `matrix` + R'WR with the rows R (k, m) and W = diag(weights).

    In the order of the control points both are banded. LevelError where the sum is not positive definite.
    """
    entries = matrix.tocoo()
    below = entries.row - entries.col
    lower_half = below >= 0
    diagonals = int(below.max()) + 1
    if R is not None:
        diagonals = max(diagonals, kernel.width(*kernel.csr_parts(R)[:2]))
    band = np.zeros((matrix.shape[0], diagonals))
    band[entries.col[lower_half], below[lower_half]] = entries.data[lower_half]
    if R is not None:
        kernel.add_weighted(band, *kernel.csr_parts(R), weights)

    lower, failed = dpbtrf(band.T, lower=True, overwrite_ab=True)
    if failed:
        raise LevelError("some control points hold no part of the level: give fewer of them")
    return BandedCholesky(lower)
