"""One call for all solvers of a level's program."""

from collections.abc import Callable

from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.program import LevelProgram
from bonecam.levels.solvers import admm, osqp
from bonecam.plugins import added, run_added

SOLVERS: dict[str, Callable[[LevelProgram], Float[ndarray, "m 3"]]] = {"admm": admm.solve, "osqp": osqp.solve}
"""By the name that `levels.solver` has in a job; users and packages add more such functions."""


def solve(program: LevelProgram, solver: str = "admm") -> Float[ndarray, "m 3"]:
    """The free moves (m, 3) of the control points that solve a level's program.

    LevelError where the solver finds none.
    """
    if solver in SOLVERS:
        return SOLVERS[solver](program)
    with run_added("solvers", solver):
        return added("solvers", solver)(program)
