"""The published program of one level solved exactly over all of the surface.

The paper samples and stops there. Here every watched sample that breaks a limit joins the program, which is
solved again: an exchange method. Seconds a level.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError, place_name
from bonecam.levels.problem.published import TOLERANCE, PublishedProgram
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE
from bonecam.levels.solvers.clarabel import solve_cones

ROUNDS = 12
"""So often at most; what the check of levels allows is taken then."""


def next_moves(
    program: PublishedProgram, P: Float[ndarray, "c 3"], depth: float, stiffness: float
) -> Float[ndarray, "c 3"]:
    """The moves (c, 3) from the level with control points P to the next, at most `depth` mm.

    LevelError where the limits cannot be held to DEPTH_TOLERANCE mm.
    """
    energy, gradient = program.terms(P, stiffness)
    active = program.first
    walls = program.walls_near(P, depth)
    for _ in range(ROUNDS):
        cones, planes = program.limits(P, depth, active, walls)
        moves = solve_cones(energy, gradient, cones, planes)
        broken, outside = program.broken(P, moves, depth)
        if broken.max() <= TOLERANCE or program.printed:
            return moves
        active = np.union1d(active, program.worst(broken))
        walls = walls.and_planes(program.walls(P, P + moves, program.worst(outside)))
    if broken.max() <= DEPTH_TOLERANCE:
        return moves
    place = program.watched(P + moves)[np.argmax(broken)]
    what = (
        f"the published program leaves its limits by {broken.max():.4f} mm at {place_name(place)} after {ROUNDS} rounds"
    )
    raise LevelError(f"{what}: raise surface.max_control_points", place=place)
