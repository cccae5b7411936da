"""The thin plate, twice: stiffness of the moves, D'MD, and bending of the new level, (P + D)'M(P + D), as
published.

Stiffness keeps the net from crumpling; bending fills hollows as the level goes and keeps walls from standing
up. The weight of bending falls with the depth squared.
"""

import numpy as np

from bonecam.levels.problem.cut import ROUGH
from bonecam.levels.problem.energies.energy import Given, Quadratic


def plate(given: Given) -> Quadratic:
    """Stiffness and bending on the free moves D, less their value at D = 0."""
    M, free = given.discretisation.M, given.discretisation.free
    bending = given.parameters.bending * (given.cut.depth / ROUGH) ** 2
    matrix = (given.parameters.stiffness + bending) * given.discretisation.free_M
    return Quadratic(matrix, np.asarray(bending * (free.T @ (M @ given.before.control_points))))
