"""The levels of the published program, solved exactly: the reference of the default ones. Seconds a level."""

from collections.abc import Callable

import numpy as np
from numpy import ndarray

from bonecam.errors import LevelError, place_name
from bonecam.levels.measure.grid import level_grid
from bonecam.levels.problem.published import PublishedProgram
from bonecam.levels.solvers.published import next_moves
from bonecam.mesh.distance import MeshDistance
from bonecam.progress import Progress, report
from bonecam.setup.schedule import Schedule
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline

CHORD = 0.02
"""Chord tolerance (mm) of the meshes on which the distance left to the stock is measured."""
STALL = 0.25
"""A level stalls that brings the stock nearer by less than this share of its depth."""
SOFTEN, SOFTEST = 0.5, 1e-9
"""Where a level stalls the stiffness falls to this share, down to this (parameters in [0, 1])."""
STILL = 0.05
"""No control point moves where all move less than this share of the depth."""
MOST_TIMES = 4
"""So many times K_min levels are made at most."""
MAX_STALLED = 10
"""So many levels in turn may stall, which is as many as it takes to soften: with nesting kept and every place
watched the bounding sphere's pull brings 3midph no nearer than 0.57 mm to its capsule, in 20 s a level."""


def published_sequence(
    surface: TSpline,
    stock: Stock,
    schedule: Schedule,
    stiffness: float,
    attraction: str,
    left: Callable[[ndarray], tuple[float, ndarray]],
    progress: Progress,
) -> list[ndarray]:
    """Control points of levels 0, 1, 2, ... up to the last below the stock, by the published program.

    `left` gives the largest distance (mm) from the stock to the level with these control points, and where.
    The stiffness falls where progress stalls. LevelError where progress ends.
    """
    program, made = PublishedProgram(surface, stock, attraction), [np.array(surface.control_points)]
    rest, place = left(made[0])
    whole, most, stalls = rest, MOST_TIMES * schedule.lower_bound(rest), 0
    remedy = f"raise surface.max_control_points{', or take levels.attraction stock' if attraction == 'sphere' else ''}"
    while rest > schedule.limit(len(made)):
        k, before = len(made), rest
        report(progress, 1 - rest / whole, f"level {k} by cones")
        try:
            moves = next_moves(program, made[-1], schedule.limit(k), stiffness)
        except LevelError as error:
            raise LevelError(f"level {k}: {error}", level=k, **error.evidence) from error
        made.append(made[-1] + moves)
        rest, place = left(made[-1])
        stalled = rest > before - STALL * schedule.limit(k)
        stalls, stiffness = (stalls + 1, max(SOFTEST, stiffness * SOFTEN)) if stalled else (0, stiffness)
        if (
            k >= most
            or stalls > MAX_STALLED
            or np.linalg.norm(moves, axis=1).max() < STILL * schedule.limit(k)
        ):
            raise LevelError(
                f"level {k} gets no nearer to the stock than {rest:.3f} mm at {place_name(place)}: {remedy}",
                level=k,
                place=place,
            )
    return made


def distance_left(surface: TSpline, stock: Stock) -> Callable[[ndarray], tuple[float, ndarray]]:
    """A function of control points: the largest distance (mm) from the stock to the level that has them, and
    where."""
    grid = level_grid(surface, [surface.control_points], CHORD)
    targets = stock.mesh(CHORD).vertices

    def left(P: ndarray) -> tuple[float, ndarray]:
        distance = MeshDistance(grid.mesh(P)).unsigned(targets)
        return float(distance.max()), targets[np.argmax(distance)]

    return left
