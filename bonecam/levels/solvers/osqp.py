"""One convex quadratic program, min 1/2 x'Px + q'x subject to low <= A x <= high: the only door to OSQP.

The solver's word is not trusted: the largest violation of the answer is measured here, in the rows' own unit
(mm).
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.linalg.lapack import dpbtrf, dpbtrs

from bonecam.errors import LevelError
from bonecam.kernels import normal_equations as kernel


@dataclass(frozen=True, eq=False)
class Rows:
    """Linear limits low <= A x <= high; `pushed` rows together with `stacked`."""

    A: sp.csr_array
    low: Float[ndarray, "r"]
    high: Float[ndarray, "r"]


@dataclass(frozen=True, eq=False)
class Solution:
    """The answer, how far it violates the rows (mm), and how many iterations it took."""

    x: Float[ndarray, "v"]
    violation: float
    iterations: int


def stacked(*rows: Rows) -> Rows:
    """All rows as one."""
    A = sp.csr_array(sp.vstack([r.A for r in rows]))
    return Rows(A, np.concatenate([r.low for r in rows]), np.concatenate([r.high for r in rows]))


def solve(
    P: sp.csc_array,
    q: Float[ndarray, "v"],
    rows: Rows,
    tolerance: float,
    start: Float[ndarray, "v"] | None = None,
) -> Solution:
    """The minimum; LevelError where OSQP does not finish or its answer violates a row by more than 20
    tolerances.

    `P` is symmetric and positive semidefinite; `tolerance` is in mm.
    """
    import osqp

    solver = osqp.OSQP()
    solver.setup(
        sp.csc_matrix(sp.triu(P, format="csc")),
        q,
        sp.csc_matrix(rows.A),
        rows.low,
        rows.high,
        verbose=False,
        eps_abs=tolerance,
        eps_rel=tolerance,
        max_iter=4000,
        check_termination=20,
        adaptive_rho_interval=40,
        polishing=False,
    )
    if start is not None:
        solver.warm_start(x=start)
    answer = solver.solve(raise_error=False)
    status = answer.info.status
    if status not in ("solved", "maximum iterations reached", "solved inaccurate"):
        raise LevelError(
            f"the level's limits contradict each other (OSQP: {status}): give a shallower depth or a larger stock"
        )
    x = np.array(answer.x, dtype=np.float64)
    value = rows.A @ x
    violation = float(max(0.0, (rows.low - value).max(), (value - rows.high).max()))
    if not np.isfinite(x).all() or violation > 20 * tolerance:
        raise LevelError(
            f"OSQP left the limits by {violation:.2g} mm ({status}): give a lower stiffness",
            violation=violation,
        )
    return Solution(x, violation, int(answer.info.iter))


@dataclass(frozen=True, eq=False)
class Factor:
    """The Cholesky factor of a band: `lower` diagonals, the main one first. (By LAPACK itself: the wrapper
    would take as long.)"""

    lower: Float[ndarray, "d m"]

    def solve(self, b: Float[ndarray, "m 3"]) -> Float[ndarray, "m 3"]:
        """The solutions for three right sides."""
        return np.asarray(dpbtrs(self.lower, b, lower=True)[0])


def factor(
    matrix: sp.csc_array, R: sp.csr_array | None = None, weights: Float[ndarray, " k"] | None = None
) -> Factor:
    """Of a matrix over the control points, in whose order it is a band, and R'WR; LevelError where that is
    not positive definite."""
    entries = matrix.tocoo()
    below = entries.row - entries.col
    half = below >= 0
    diagonals = (
        int(below.max()) + 1 if R is None else max(int(below.max()) + 1, kernel.width(R.indptr, R.indices))
    )
    band = np.zeros((matrix.shape[0], diagonals))
    band[entries.col[half], below[half]] = entries.data[half]
    if R is not None:
        kernel.add_weighed(band, R.indptr, R.indices, R.data, weights)
    lower, failed = dpbtrf(band.T, lower=True, overwrite_ab=True)
    if failed:
        raise LevelError("some control points hold no part of the level: give fewer of them")
    return Factor(lower)
