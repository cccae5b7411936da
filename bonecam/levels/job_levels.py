"""The levels that a job asks for, and the surface of the part that they start from.

How a surface is parametrised decides how sharply it bends where its rows crowd, and levels fold there first: where its
levels fail the surface is smoothed where it bends far more sharply than a ball can follow. Where that does not help, or
a surface is refused, the fit starts again with fewer control points, within a wider tolerance, or from other rows.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

from bonecam.errors import LevelError, SurfaceError
from bonecam.job import Job, LevelsJob
from bonecam.levels.edge_rounding import begin_levels, levels_in
from bonecam.levels.measure import NO_CUT, PartLevel, StockLevel
from bonecam.levels.sequences import Morph
from bonecam.levels.solvers.clarabel import require_clarabel
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.part import Part
from bonecam.mesh.rows import MOST_CHOICES, Rows
from bonecam.progress import Progress, part, report, rising, silent
from bonecam.runtime.timing import StageTimes
from bonecam.setup.placement import Setup
from bonecam.setup.schedule import Schedule, even_out, schedule_of
from bonecam.setup.stock import Stock
from bonecam.surface.growth import Fit
from bonecam.surface.part_surface import fit_surface, part_rows, smoother_fit
from bonecam.surface.tspline import TSpline

TRIES = 3
"""Depths that are tried before the given ones are kept."""
SPARE = 1.004
"""The first is deeper than even cuts by this factor: levels use a little less than all of their depth."""
ENOUGH = 0.9
"""An outermost cut that uses this share of its depth is even enough."""


def surface_and_levels(
    setup: Setup, job: Job, times: StageTimes | None = None, progress: Progress = silent, given: Fit | None = None
) -> tuple[Fit, Morph]:
    """The fitted surface, or the `given` one, and its measured levels, from the first of `fit_choices` with which both
    succeed.

    Where none does, the SurfaceError or LevelError of the first. `times` gets the stages surface and levels of the one
    that counts.
    """
    times = times or StageTimes()
    progress = rising(progress)
    fitting, morphing = part(progress, 0.0, 0.45), part(progress, 0.45, 1.0)
    choices = fit_choices(setup.part, job, part(fitting, 0.0, 0.1)) if given is None else [(None, None)]
    failure: SurfaceError | LevelError | None = None
    for rows, tolerance in choices:
        try:
            with times.stage("surface"):
                fitted = fit_surface(setup.part, job, part(fitting, 0.1, 1.0), given, rows, tolerance)
            with times.stage("levels"):
                return fitted, make_levels(fitted.surface, setup.stock, job, morphing)
        except LevelError as error:
            failure = failure or error
            smoother = None if given else _smoother(fitted, setup, job=job, times=times, progress=morphing, error=error)
            if smoother is not None:
                return smoother
            report(fitting, 0.0, f"{error}; the fit starts again")
        except SurfaceError as error:
            failure = failure or error
            report(fitting, 0.0, f"{error}; the fit starts again")
    assert failure is not None
    raise failure


def fit_choices(placed: Part, job: Job, progress: Progress = silent) -> Iterator[tuple[Rows, float]]:
    """Rows and tolerances (mm) to fit a part with, each where those before it fail: the usual rows within the tolerance
    that the job has for its facets, then within the widest that it has for any; other rows; and the usual ones within
    twice that, or `surface.largest_deviation`, for a surface of few control points."""
    choices = islice(part_rows(placed, job, progress), MOST_CHOICES)
    usual = next(choices)
    widest = job.surface.tolerance_for()
    for tolerance in dict.fromkeys((job.surface.tolerance_for(placed.sagitta), widest)):
        yield usual, tolerance
    yield from ((rows, widest) for rows in choices)
    if widest < job.surface.largest_deviation:
        yield usual, min(2 * widest, job.surface.largest_deviation)


def _smoother(
    fitted: Fit, setup: Setup, job: Job, times: StageTimes, progress: Progress, error: LevelError
) -> tuple[Fit, Morph] | None:
    """The surface whose levels failed by the `error` without its sharp bends, and its levels; None where it has none,
    or its levels fail as well."""
    try:
        with times.stage("levels"):
            smoother = smoother_fit(fitted, setup.part, job)
            if smoother is None:
                return None
            report(progress, 0.0, f"{error}; sharp bends are smoothed")
            return smoother, make_levels(smoother.surface, setup.stock, job, progress)
    except (LevelError, SurfaceError):
        return None


def make_levels(surface: TSpline, stock: Stock, job: Job, progress: Progress = silent) -> Morph:
    """The measured levels from a closed part to its stock, with the parameters of `job.levels`; of another
    strategy than morphing only the part and the stock."""
    if job.path.strategy != "morph":
        return part_and_stock(surface, stock, job.levels.chord_tolerance)
    levels_to = even_levels if job.levels.even else levels_in
    return levels_to(
        surface,
        stock,
        schedule_of(job.levels),
        stiffness=job.levels.stiffness,
        attraction=job.levels.attraction,
        method=job.levels.method,
        solver=job.levels.solver,
        chord_tolerance=job.levels.chord_tolerance,
        progress=progress,
    )


def part_and_stock(surface: TSpline, stock: Stock, chord_tolerance: float) -> Morph:
    """The part and the stock without levels between them, for a strategy that does not morph."""
    part = PartLevel(surface, surface.tessellate(chord_tolerance), NO_CUT)
    around = stock.mesh(chord_tolerance)
    distance = float(MeshDistance(part.mesh).unsigned(around.vertices).max())
    levels = part, StockLevel(1, around, distance, NO_CUT)
    return Morph(levels, lower_bound=1, distance=distance, solve_seconds=0.0, check_seconds=0.0)


def check_method(levels: LevelsJob) -> None:
    """JobError where the solver of the levels is not installed."""
    if levels.method != "qp":
        require_clarabel("method", levels.method, "qp")
    elif levels.solver == "clarabel":
        require_clarabel("solver", "clarabel", "admm")


def even_levels(surface: TSpline, stock: Stock, schedule: Schedule, **options: Any) -> Morph:
    """The levels of `levels_in` with roughing cuts so shallow that the morph's outermost cut is as deep as they are.

    The number of cuts is that of the given depths; where shallower cuts need one more, the depth is raised again
    half way, at last to what was given. Only the levels that are kept are measured.
    """
    given = begin_levels(surface, stock, schedule, **options)
    cuts = len(given.morph.first)
    rest = given.morph.rest
    if rest >= ENOUGH * schedule.limit(cuts):
        return given.measured()
    depth = SPARE * even_out(schedule, given.morph.distance, cuts, rest).beyond
    for _ in range(TRIES):
        if depth >= schedule.beyond:
            break
        tried = begin_levels(surface, stock, Schedule(schedule.first, depth), **options)
        if tried.cuts <= given.cuts and len(tried.morph.first) <= cuts:
            return replace(tried.measured(), lower_bound=given.lower_bound(schedule))
        depth = (depth + schedule.beyond) / 2
    return given.measured()
