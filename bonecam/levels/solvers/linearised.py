"""The program of one level as quadratic programs with linear limits, for solvers that know nothing of surfaces.

The limits are planes that hold near the place where they were set up. So a program is solved, set up again at
the answer, and solved again.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.program import LevelProgram, LinearLimits

SET_UPS = 3
"""How often the planes are set up."""

Minimum = Callable[[LinearLimits, Float[ndarray, " v"]], Float[ndarray, " v"]]
"""The stacked moves (x, y, z) of least energy within the limits, searched from given ones."""


def solve_linearised(program: LevelProgram, minimum: Minimum) -> Float[ndarray, "m 3"]:
    """The free moves (m, 3) of a level's program, each quadratic program solved by `minimum`."""
    moves = np.zeros((program.matrix.shape[0], 3))
    for _ in range(SET_UPS):
        limits = program.limits.rows(program.R, program.x)
        moves = minimum(limits, moves.T.ravel()).reshape(3, -1).T
        program = program.at(moves)
    return moves
