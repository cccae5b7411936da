"""The levels of the published program, solved exactly: the reference of the default ones. Seconds a level."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError
from bonecam.levels.measure.grid import LevelGrid, level_grid
from bonecam.levels.problem.published import PublishedProgram
from bonecam.levels.sequences.loop import Stop, levels_to_stock, stalls
from bonecam.levels.solvers.published import next_moves
from bonecam.mesh.distance import MeshDistance
from bonecam.progress import Progress
from bonecam.setup.schedule import Schedule
from bonecam.surface.tspline import TSpline

CHORD = 0.02
"""Chord tolerance (mm) of the meshes on which the distance left to the stock is measured."""
SOFTEN, SOFTEST = 0.5, 1e-9
"""Where a level stalls the stiffness falls to this share, down to this (parameters in [0, 1])."""
STILL = 0.05
"""A sequence ends where all control points of a level move less than this share of its depth."""
MOST_TIMES = 4
"""So many times K_min levels are made at most."""
MAX_STALLED = 10
"""So many levels in turn may stall, which is as many as it takes to soften: with nesting kept and every place
watched the bounding sphere's pull brings 3midph no nearer than 0.57 mm to its capsule, in 20 s a level."""


@dataclass(frozen=True, eq=False)
class _Rest:
    """What is left above a level: the largest distance from the stock to it, `left` mm at `place`; and the
    stiffness of the level above it."""

    left: float
    place: Float[ndarray, "3"]
    stiffness: float


def published_sequence(
    program: PublishedProgram, surface: TSpline, schedule: Schedule, stiffness: float, progress: Progress
) -> list[ndarray]:
    """Control points of levels 0, 1, 2, ... up to the last below the stock, by the `program` of a `surface`.

    The stiffness falls where progress stalls. LevelError where progress ends.
    """
    grid = level_grid(surface, [surface.control_points], CHORD)
    targets = program.stock.mesh(CHORD).vertices
    other = ", or take levels.attraction stock" if program.attraction == "sphere" else ""
    remedy = f"raise surface.max_control_points{other}"

    def next_level(P: ndarray, k: int, rest: _Rest) -> ndarray:
        moves = next_moves(program, P, schedule.limit(k), rest.stiffness)
        if np.linalg.norm(moves, axis=1).max() < STILL * schedule.limit(k):
            raise LevelError(f"the published program hardly moves it any more: {remedy}", place=rest.place)
        return P + moves

    def rest_above(P: ndarray, k: int, before: _Rest) -> _Rest:
        rest = _Rest(*distance_left(grid, P, targets), before.stiffness)
        softer = max(SOFTEST, SOFTEN * before.stiffness)
        return replace(rest, stiffness=softer) if stalls(before, rest, schedule.limit(k)) else rest

    first = np.array(surface.control_points)
    rest = _Rest(*distance_left(grid, first, targets), stiffness)
    lower_bound = schedule.lower_bound(rest.left)
    stop = Stop(remedy, MAX_STALLED, MOST_TIMES * lower_bound)
    return levels_to_stock(
        [first],
        rest,
        schedule=schedule,
        next_level=next_level,
        rest_above=rest_above,
        stop=stop,
        progress=progress,
        lower_bound=lower_bound,
    )


def distance_left(
    grid: LevelGrid, P: Float[ndarray, "c 3"], targets: Float[ndarray, "n 3"]
) -> tuple[float, Float[ndarray, "3"]]:
    """The largest distance (mm) from points of the stock to the level with control points P, and where."""
    distance = MeshDistance(grid.mesh(P)).unsigned(targets)
    return float(distance.max()), targets[np.argmax(distance)]
