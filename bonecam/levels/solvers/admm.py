"""The program of one level by ADMM, the alternating direction method of multipliers (Boyd et al. 2011; Stellato
et al. 2020, OSQP): the default solver.

In turn every sample goes to the nearest point within its own limits, and the control points to the least-squares
fit of the samples. The matrix of that fit is the same for x, y and z and for all iterations: one small banded
factor a level. The planes of the limits are set up again as the samples move, every SET_UP_EVERY iterations.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels import matrices
from bonecam.levels.problem import factorise
from bonecam.levels.program import LevelProgram

ITERATIONS = 240
"""The most iterations of a level."""
SET_UP_EVERY = 20
"""Iterations between two set-ups of the limits' planes."""
RHO = 32.0
"""Penalty of ADMM for samples off their limits, as a factor of their weights in the energy."""
RELAXATION = 1.6
"""Over-relaxation of ADMM: 1.5 to 1.8 is usual (Boyd et al. 2011, section 3.4.3)."""
SETTLED = 1e-3
"""ADMM ends where its samples move and miss their limits by a smaller share of how far they are pulled, root mean
square: energies end 2 % above the least on a phalanx."""


def solve(
    program: LevelProgram, iterations: int = ITERATIONS, set_up_every: int = SET_UP_EVERY
) -> Float[ndarray, "m 3"]:
    """The free moves (m, 3) of a level's program, in so many iterations at most."""
    R, x = program.R, program.x
    csr = R.indptr, R.indices, R.data
    linear = program.net.linear / RHO
    fit = factorise(sp.csc_array(program.net.matrix / RHO), R, program.weights)
    settled = SETTLED**2 * program.weights @ ((program.H - x) ** 2).sum(1)
    z, u = program.start.copy(), np.zeros_like(x)
    y, moments = np.empty_like(x), np.empty_like(linear)

    D = fit.solve(R.T @ (program.weights[:, None] * (z - x)) - linear)
    for k in range(1, iterations + 1):
        if k % set_up_every == 0:
            program = program.at(D)
        matrices.times(*csr, np.ascontiguousarray(D), y)
        unsettled = matrices.sweep(
            x=x,
            y=y,
            H=program.H,
            planes=program.limits.planes,
            weights=program.weights,
            rho=RHO,
            relaxation=RELAXATION,
            z=z,
            u=u,
        )
        matrices.transposed_times(*csr, y, moments)
        D = fit.solve(moments - linear)
        if k > set_up_every and unsettled < settled:
            break
    return np.asarray(D)
