"""The only door to OSQP: convex quadratic programs min 1/2 x'Px + q'x subject to low <= A x <= high.

The solver's own status is not trusted: the largest violation of its answer is measured here, in the unit of the
limits (mm).
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError
from bonecam.levels.program import LevelProgram, LinearLimits
from bonecam.levels.solvers.linearised import solve_linearised

TOLERANCE = 1e-5
"""Of the limits of one level (mm), and of the optimality conditions."""
MOST_ITERATIONS = 4000
CHECK_EVERY = 20
ADAPT_RHO_EVERY = 40
"""Iterations of ADMM: the most, between two checks of the residuals, between two new step sizes rho."""
ACCEPTED = 20.0
"""Violations are accepted up to so many tolerances: OSQP scales its residuals."""


def solve(program: LevelProgram) -> Float[ndarray, "m 3"]:
    """The free moves of a level's program by OSQP, every limit a row: many times slower than `admm`."""
    energy = sp.csc_array(sp.block_diag([program.matrix] * 3))

    def minimum(limits: LinearLimits, start: Float[ndarray, " v"]) -> Float[ndarray, " v"]:
        return solve_qp(energy, program.gradient.T.ravel(), limits, TOLERANCE, start)

    return solve_linearised(program, minimum)


def solve_qp(
    P: sp.csc_array,
    q: Float[ndarray, "v"],
    limits: LinearLimits,
    tolerance: float,
    start: Float[ndarray, "v"] | None = None,
) -> Float[ndarray, "v"]:
    """The minimum, searched from `start`; `P` is symmetric and positive semidefinite, `tolerance` in mm.

    LevelError where OSQP does not finish or its answer violates a limit by more than ACCEPTED tolerances.
    """
    import osqp

    solver = osqp.OSQP()
    solver.setup(
        sp.csc_matrix(sp.triu(P, format="csc")),
        q,
        sp.csc_matrix(limits.A),
        limits.low,
        limits.high,
        verbose=False,
        eps_abs=tolerance,
        eps_rel=tolerance,
        max_iter=MOST_ITERATIONS,
        check_termination=CHECK_EVERY,
        adaptive_rho_interval=ADAPT_RHO_EVERY,
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
    value = limits.A @ x
    violation = float(max(0.0, (limits.low - value).max(), (value - limits.high).max()))
    if not np.isfinite(x).all() or violation > ACCEPTED * tolerance:
        raise LevelError(
            f"OSQP left the limits by {violation:.2g} mm ({status}): give a lower stiffness", violation=violation
        )
    return x
