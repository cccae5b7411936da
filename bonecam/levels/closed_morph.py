"""The part's T-spline with more control points, for its levels: the same surface on a refine_for_depth T-mesh (exact
knot insertion, Boehm 1980).

Where part of a level lies at the stock's wall already and the rest still moves there is a rim between, which
wanders over all of the surface from level to level. Within about a span of it a T-spline rounds it off, and
depth is lost; so no span may be much longer than a cut is deep. Spans are measured on the stock, at the
nearest points, where levels end.

The morph: from the part to the stock in as few levels as the depths allow (Gan et al. 2014, section 4.2).

Every level has the T-mesh and weights of the part; only control points change. Levels are made until every
point of the stock's surface lies within one depth of the last one; the stock itself is the level after that.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import SurfaceError, require_type
from bonecam.job import LevelsJob
from bonecam.job.levels_section import METHODS
from bonecam.levels.measure import Rules, inspect
from bonecam.levels.problem import ATTRACTIONS, NESTING_TOLERANCE, STOCK_TOLERANCE, discretise, remaining, whole
from bonecam.levels.sequences import ACCEPTED, BegunMorph, Morph, SequenceMaker
from bonecam.levels.solvers.solver import SOLVERS
from bonecam.mesh.distance import MeshDistance
from bonecam.plugins import added, added_names, run_added
from bonecam.progress import Progress, part, rising, silent
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.setup.rounding import MARGIN, require_inside
from bonecam.setup.stock import Schedule, Stock
from bonecam.surface.refinement import with_row_knots
from bonecam.surface.tessellation import require_valid
from bonecam.surface.tspline import TSpline

IN_CAPSULES = (14.0, 800, 3000)
WITH_FLATS = (6.5, 1000, 1000)
COARSER = 1.25
"""So many depths long may spans be, of surfaces of fewer than so many control points, of so many at most: in
a capsule, and in a stock with flats, which a level reaches long before the edges between them. So much
longer, and again, where that would take more control points. Where spans are too long for what is left, levels
stall: a whole femur's reach the stock with 2,566 control points, not with 1,500. Shorter spans follow hollows that
no cutter enters."""
STRETCHED = 4.0
"""Neighbours on both sides of the stock's axis have their nearest points on the stock far apart, however near
they are."""
AROUND = 64
"""Lines round the surface on which the distance between two rows is taken; their mean counts."""
ALONG = 4
"""Pieces in which the length of a span is taken."""


def refine_for_depth(surface: TSpline, stock: Stock, depth: float) -> TSpline:
    """The surface with spans halved until they are short enough for cuts so deep (mm); one that has many
    control points as it is."""
    depths, few, most = WITH_FLATS if stock.has_flats else IN_CAPSULES
    longest = depths * depth
    while surface.tmesh.size < few:
        refined = _across(_along(surface, stock, longest, most), stock, longest, most)
        if refined.tmesh.size <= most:
            return refined
        longest *= COARSER
    return surface


def _along(surface: TSpline, stock: Stock, longest: float, most: int) -> TSpline:
    """Rows between rows that are farther apart, in the mean, than `longest` mm."""
    s = np.repeat(np.arange(AROUND) / AROUND, ALONG + 1)
    while True:
        knots = np.unique(surface.tmesh.t_knots)
        lines = (np.tile(np.linspace(low, high, ALONG + 1), AROUND) for low, high in pairwise(knots))
        long = np.array([_length(surface, stock, s, t).mean() for t in lines]) > longest
        if surface.tmesh.size > most or not long.any():
            return surface
        t = ((knots[:-1] + knots[1:]) / 2)[long]
        surface = surface.refine(np.zeros(len(t)), t, "t")


def _across(surface: TSpline, stock: Stock, longest: float, most: int) -> TSpline:
    """Knots in the intervals of rows that are longer than `longest` mm."""
    (low, high) = surface.domain[1]
    t_knots = surface.tmesh.t_knots
    while True:
        fresh = []
        for j, knots in enumerate(surface.tmesh.s_knots):
            step = np.diff(knots, append=knots[0] + 1)
            s = (knots[:, None] + step[:, None] * np.linspace(0, 1, ALONG + 1)).ravel()
            t = np.full(len(s), np.clip(t_knots[j + 1 : j + 4].mean(), low, high))
            long = (_length(surface, stock, s, t) > longest) & (len(knots) > 1)
            fresh.append(np.mod(knots + step / 2, 1.0)[long])
        if surface.tmesh.size > most or not any(len(knots) for knots in fresh):
            return surface
        surface = with_row_knots(surface, fresh)


def _length(surface: TSpline, stock: Stock, s: ndarray, t: ndarray) -> ndarray:
    """Lengths, mm, of lines on the surface as they lie on the stock, but STRETCHED times their own at most:
    each of ALONG pieces, with its ends among s and t."""
    points = surface.positions(np.mod(s, 1.0), t)
    there, here = (
        lengths(np.diff(p.reshape(-1, ALONG + 1, 3), axis=1).reshape(-1, 3))
        for p in (stock.closest_points(points), points)
    )
    return np.minimum(there, STRETCHED * here).reshape(-1, ALONG).sum(axis=1)


@dataclass(frozen=True)
class Method:
    """How levels are made: `levels` takes surface, stock, schedule, attraction, stiffness and progress, and returns
    the control points of levels 0, 1, 2, ... up to the last below the stock; None: by quadratic programs.

    A level may fall behind the one before by `nesting` and leave the stock by `outside`, mm; one that breaks its limits
    by more than `accepted` (mm) is refused.
    """

    levels: Callable[[TSpline, Stock, Schedule, str, float, Progress], list[ndarray]] | None = None
    nesting: float = NESTING_TOLERANCE
    outside: float = STOCK_TOLERANCE
    accepted: float = ACCEPTED


def method_of(name: str) -> Method:
    """The method of a name that `levels.method` has in a job. JobError where one that was added cannot be loaded."""
    return Method() if name == "qp" else added("methods", name)


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
    (`admm`, as a reference `osqp`, or one that was added), or a method that was added. SurfaceError where the surface
    is no closed body's between two poles, StockError where it leaves the stock, JobError where a number is out of
    range, LevelError where a level cannot be made.
    """
    require_types(surface, schedule, stock)

    # ValueError where a name is not among its choices, JobError where a number is out of its range
    for name, value, choices in (
        ("attraction", attraction, ATTRACTIONS),
        ("method", method, METHODS),
        ("solver", solver, (*SOLVERS, *added_names("solvers"))),
    ):
        if value not in tuple(choices):
            raise ValueError(f"{name} {value!r}: choose one of {', '.join(choices)}")
    LevelsJob(stiffness=stiffness, chord_tolerance=chord_tolerance)

    # SurfaceError where the surface bounds no body, StockError where that leaves the stock, LevelError where it takes
    # too many cuts
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

    started = time.perf_counter()
    progress = rising(progress)
    solving, measuring = part(progress, 0.0, 0.7), part(progress, 0.7, 1.0)
    if method == "qp":
        surface = refine_for_depth(surface, stock, schedule.beyond)
    discretisation = discretise(surface, stock, ATTRACTIONS[attraction])
    around = whole(stock)
    rest = remaining(discretisation, surface.control_points, around)
    made_by = method_of(method)
    rules = Rules(stock, schedule, made_by.nesting, made_by.outside, chord_tolerance)
    measure = partial(inspect, surface, rules=rules, progress=measuring)

    lower_bound = schedule.lower_bound(rest.left)
    if made_by.levels is not None:
        maker = None
        with run_added("methods", method):
            sequences = iter([made_by.levels(surface, stock, schedule, attraction, stiffness, solving)])
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
        accepted=made_by.accepted,
    )


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
