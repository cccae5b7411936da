"""The morph: from the part to the stock in as few levels as the depths allow (Gan et al. 2014, section 4.2).

Every level has the T-mesh and weights of the part; only control points change. Levels are made until every
point of the stock's surface lies within one depth of the last one; the stock itself is the level after that.
"""

import math
import time
from functools import partial
from typing import Any

from bonecam.errors import SurfaceError, require_type
from bonecam.job import LevelsJob
from bonecam.levels.measure.inspection import Rules, inspect
from bonecam.levels.problem.discretisation import discretise
from bonecam.levels.problem.energies.attraction import ATTRACTIONS
from bonecam.levels.problem.published import PublishedProgram
from bonecam.levels.problem.remaining import remaining, whole
from bonecam.levels.problem.tolerances import NESTING_TOLERANCE, STOCK_TOLERANCE
from bonecam.levels.refine_for_depth import refine_for_depth
from bonecam.levels.sequences.begun_morph import BegunMorph, Morph
from bonecam.levels.sequences.published_sequence import published_sequence
from bonecam.levels.sequences.restore_feasibility import ACCEPTED
from bonecam.levels.sequences.sequence_maker import SequenceMaker
from bonecam.levels.solvers.solver import SOLVERS
from bonecam.mesh.distance import MeshDistance
from bonecam.progress import Progress, part, rising, silent
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.setup.containment import MARGIN, require_inside
from bonecam.setup.schedule import Schedule
from bonecam.setup.stock import Stock
from bonecam.surface.tessellation.validity import require_valid
from bonecam.surface.tspline import TSpline

METHODS = {
    "qp": (NESTING_TOLERANCE, STOCK_TOLERANCE),
    "qcqp": (0.02, 2 * STOCK_TOLERANCE),
    "published": (0.02, 2 * STOCK_TOLERANCE),
}
"""How far (mm) a level may fall behind the one before and leave the stock: the published program says nothing
of the one, and holds the other at samples only."""
STIFFNESS = 5e-7
"""c_int / c_ext, parameters in [0, 1]."""
COARSE = 0.02
"""Chord tolerance (mm) at which the part is looked at first, and the mesh of the stock as a share of its
diameter."""


@on_one_blas_thread
def morph(surface: TSpline, stock: Stock, schedule: Schedule, **options: Any) -> Morph:
    """All levels, measured: those that `begin_morph` makes first, or makes in another way where these fail.

    `options` and errors are those of `begin_morph`; LevelError also where levels fail their check.
    """
    return begin_morph(surface, stock, schedule, **options).measured()


@on_one_blas_thread
def begin_morph(
    surface: TSpline,
    stock: Stock,
    schedule: Schedule,
    *,
    stiffness: float = STIFFNESS,
    attraction: str = "stock",
    method: str = "qp",
    solver: str = "admm",
    chord_tolerance: float = 0.01,
    progress: Progress = silent,
) -> BegunMorph:
    """The levels that are made first, to be measured on tessellations within `chord_tolerance` mm.

    `stiffness` is c_int / c_ext (parameters in [0, 1]). `method` is `qp`, whose programs `solver` solves
    (`admm`, or as a reference `osqp` or `clarabel`), or `qcqp`, the published program solved exactly
    (`published_sequence.py`), or `published`, the same as the paper prints it, whatever limits that breaks: both
    slow. SurfaceError where the surface is no closed body's between two poles, StockError where it leaves the stock,
    JobError where a number is out of range, LevelError where a level cannot be made.
    """
    require_types(surface, schedule, stock)

    # ValueError where a name is not among its choices, JobError where a number is out of its range
    for name, value, choices in (
        ("attraction", attraction, ATTRACTIONS),
        ("method", method, METHODS),
        ("solver", solver, SOLVERS),
    ):
        if value not in tuple(choices):
            raise ValueError(f"{name} {value!r}: choose one of {', '.join(choices)}")
    LevelsJob(stiffness=stiffness, chord_tolerance=chord_tolerance)

    _require_closed_inside(surface, stock, schedule)
    started = time.perf_counter()
    progress = rising(progress)
    solving, measuring = part(progress, 0.0, 0.7), part(progress, 0.7, 1.0)
    if method == "qp":
        surface = refine_for_depth(surface, stock, schedule.beyond)
    discretisation = discretise(surface, stock, ATTRACTIONS[attraction])
    around = whole(stock)
    rest = remaining(discretisation, surface.control_points, around)
    nesting_tolerance, stock_tolerance = METHODS[method]
    rules = Rules(stock, schedule, nesting_tolerance, stock_tolerance, chord_tolerance)
    measure = partial(inspect, surface, rules=rules, progress=measuring)

    lower_bound = schedule.lower_bound(rest.left)
    if method != "qp":
        maker = None
        program = PublishedProgram(surface, stock, attraction, printed=method == "published")
        sequences = iter([published_sequence(program, surface, schedule, stiffness, solving)])
    else:
        maker = SequenceMaker(
            discretisation, around, schedule, lower_bound, solving, solver=solver, stiffness=stiffness
        )
        sequences = maker.all(rest)
    first = next(sequences)
    left = remaining(discretisation, first[-1], around).left
    seconds = time.perf_counter() - started
    return BegunMorph(
        schedule=schedule,
        first=first,
        others=sequences,
        maker=maker,
        measure=measure,
        distance=rest.farthest,
        apart=rest.left,
        rest=left,
        seconds=seconds,
        accepted=math.inf if method == "published" else ACCEPTED,
    )


def _require_closed_inside(surface: TSpline, stock: Stock, schedule: Schedule) -> None:
    """SurfaceError where the surface bounds no body, StockError where that leaves the stock, LevelError where
    it takes too many cuts."""
    if not all(surface.poles):
        raise SurfaceError(
            "the surface is not closed between two poles: morph an open one with "
            "bonecam.levels.open_morph.morph_open, or close its ends"
        )
    require_seeds_inside(stock, surface)
    mesh = require_valid(surface, COARSE, "the part")
    require_inside(stock, mesh.vertices, MARGIN)
    farthest = MeshDistance(mesh).unsigned(stock.mesh(COARSE * stock.diameter).vertices).max()
    schedule.lower_bound(float(farthest) - COARSE)


def require_types(surface: object, schedule: object, *stocks: object) -> None:
    """TypeError where an argument is no surface, schedule or stock of a closed part."""
    require_type(surface, TSpline, "surface", "TSpline, such as fit(mesh).surface or skin(rows)")
    for stock in stocks:
        require_type(stock, Stock, "stock", "Capsule, Cylinder, Box or ConvexStock, such as stock_for finds")
    require_type(schedule, Schedule, "schedule", "Schedule, such as Schedule((0.1, 0.1), 0.5)")


def require_seeds_inside(stock: Stock, surface: TSpline) -> None:
    """StockError at once where the part leaves the stock in few of its points: one far too large would be
    tessellated for minutes first."""
    require_inside(stock, surface.positions(*surface.seeds.parameters.T), MARGIN)
