"""From a stock with edges to the morph: the levels that round a bar (Gan et al. 2014, section 5.2: "first
rounded to a capsule").

No T-spline with a bone's control points can follow an edge, so the morph ends at the stock rounded as far as
the part allows, B, and further levels round the stock S down to it. Level j of them is the body within
delta_j of B and inside S. From a point x of it the way to the nearest point of B stays inside the convex S,
so that x lies exactly |x - B| - delta_(j-1) from the level before: the depth of each of these cuts is delta_j
- delta_(j-1), and no fewer cuts could go from S to B. Machined is only the part of the surface at delta_j
  that lies inside S.

The levels that a job asks for, and the surface of the part that they start from.

How a surface is parametrised decides how sharply it bends where its rows crowd, and levels fold there first: where its
levels fail the surface is smoothed where it bends far more sharply than a ball can follow. Where that does not help, or
a surface is refused, the fit starts again with fewer control points, within a wider tolerance, or from other rows.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np

from bonecam.errors import LevelError, SurfaceError
from bonecam.job import Job
from bonecam.levels.closed_morph import begin_morph, require_seeds_inside, require_types
from bonecam.levels.measure import NO_CUT, Measures, PartLevel, RoundedLevel, StockLevel, measures_of, morph_surfaces
from bonecam.levels.open_morph import body_surfaces
from bonecam.levels.problem import factorise, integration_points, samples_of, thin_plate
from bonecam.levels.sequences import BegunMorph, Morph
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.meshlab import split_edges
from bonecam.mesh.part import Part
from bonecam.mesh.rows import MOST_CHOICES, Rows
from bonecam.mesh.solids import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh, probes
from bonecam.progress import Progress, part, report, rising, silent
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.runtime.timing import StageTimes
from bonecam.setup.placement import Setup
from bonecam.setup.rounding import MARGIN, half_spaces_of, intersect, require_inside, require_roundable
from bonecam.setup.stock import Schedule, Stock, even_out, schedule_of
from bonecam.surface.growth import Fit
from bonecam.surface.part_surface import fit_surface, part_rows, smoother_fit
from bonecam.surface.tspline import TSpline

CHORD = 0.02
"""Chord tolerance (mm) of the meshes of part, bodies and stock."""
FIT_STIFFNESS = 1e-7
"""Weight of the thin-plate energy beside the squared distances of the fitted control points."""
BISECTIONS = 30
"""Halvings of the way to a body at which it leaves the stock: 1e-9 of its length is left."""
MAX_EDGE_SHARE = 100
"""Depths are sampled on meshes with edges of at most one part in so many of their diagonal: the flat faces of
these bodies are few and large."""


@dataclass(frozen=True, eq=False)
class BegunLevels:
    """The levels in a stock that are made first, not measured yet: those of the morph to `inner`, the stock itself
    or a rounded one, and those that round the stock."""

    surface: TSpline
    part_mesh: TriangleMesh
    stock: Stock
    inner: Stock
    morph: BegunMorph

    @property
    def cuts(self) -> int:
        """The number of cuts, if the levels that are made first keep their limits."""
        k = len(self.morph.first)
        if self.inner is self.stock:
            return k
        farthest = float(self.inner.signed_distance(self.stock.mesh(CHORD).vertices).max())
        return k + len(_offsets(farthest, self.morph.schedule, k))

    @cached_property
    def distance(self) -> float:
        """The largest distance from the stock to the part, mm."""
        if self.inner is self.stock:
            return self.morph.distance
        # The largest distance of the points from the surface, mm; its mesh within CHORD tells which may have it
        points = self.stock.mesh(CHORD).vertices
        distances = MeshDistance(self.part_mesh).unsigned(points)
        return float(self.surface.project(points[distances >= distances.max() - 2 * CHORD]).distances.max())

    def lower_bound(self, schedule: Schedule) -> int:
        """K_min of a schedule."""
        if self.inner is self.stock:
            return schedule.lower_bound(self.morph.apart)
        deepest = -float(self.stock.signed_distance(self.part_mesh.vertices).min())
        return schedule.lower_bound(max(self.distance, deepest))

    @on_one_blas_thread
    def measured(self) -> Morph:
        """All levels, measured. LevelError where levels fail their check."""
        morph = self.morph.measured()
        schedule = self.morph.schedule
        if self.inner is self.stock:
            return morph
        # All levels: those of the morph to `inner`, which gets a surface, then those that round the stock down to it.
        first = morph.levels[-1]
        stock_mesh = self.stock.mesh(CHORD)
        farthest = float(self.inner.signed_distance(stock_mesh.vertices).max())
        offsets = _offsets(farthest, schedule, first.index)
        bodies = [self.inner, *(self.inner.offset(offset) for offset in offsets[:-1])]
        surfaces = body_surfaces(bodies)

        # The fit that starts at the points of the last level of the morph
        outermost = morph_surfaces(morph.levels)[-1]
        samples = samples_of(outermost, *integration_points(outermost))
        matrix = samples.N + FIT_STIFFNESS * thin_plate(outermost)
        points = samples.R @ outermost.control_points
        fit = factorise(matrix)

        levels = list(morph.levels[:-1])
        for k, (body, surface) in enumerate(zip(bodies, surfaces, strict=True), start=first.index):
            # Each point goes to the nearest point of the body, but no farther than to the wall of the stock, which
            # bisection finds
            target = body.closest_points(points)
            low = np.zeros((len(points), 1))
            high = np.ones((len(points), 1))
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                inside = self.stock.signed_distance(points + middle * (target - points))[:, None] <= 0
                low = np.where(inside, middle, low)
                high = np.where(inside, high, middle)
            control_points = fit.solve(samples.moments(points + high * (target - points)))

            if k == first.index:
                mesh, measures = first.mesh, first.measures
            else:
                half_spaces = np.vstack([half_spaces_of(stock_mesh), half_spaces_of(body.mesh(CHORD))])
                mesh = intersect(half_spaces, self.stock.middle)
                before = bodies[k - first.index - 1]
                measures = _measure(levels[-1].mesh, mesh, before, self.stock, schedule.limit(k))
            certificate = first.certificate if k == first.index else None
            limit = schedule.limit(k)
            levels.append(
                RoundedLevel(
                    k,
                    surface,
                    mesh=mesh,
                    limit=limit,
                    measures=measures,
                    stock=self.stock,
                    control_points=control_points,
                    certificate=certificate,
                )
            )

        k = first.index + len(bodies)
        measures = _measure(levels[-1].mesh, stock_mesh, bodies[-1], self.stock, schedule.limit(k))
        last = StockLevel(k, stock_mesh, schedule.limit(k), measures)
        return replace(morph, levels=(*levels, last), lower_bound=self.lower_bound(schedule), distance=self.distance)


def levels_in(surface: TSpline, stock: Stock, schedule: Schedule, **options: Any) -> Morph:
    """The morph from the part to any stock, with the levels that round a stock with edges; `options` as in
    `morph`.

    Raises StockError where the part leaves the stock or comes so near to its edges that they cannot be
    rounded over it.
    """
    return begin_levels(surface, stock, schedule, **options).measured()


@on_one_blas_thread
def begin_levels(surface: TSpline, stock: Stock, schedule: Schedule, **options: Any) -> BegunLevels:
    """The levels of `levels_in` that are made first, not measured yet."""
    require_types(surface, schedule, stock)
    require_seeds_inside(stock, surface)
    part_mesh = surface.tessellate(CHORD)
    inner = stock
    if stock.has_edges:
        require_inside(stock, part_mesh.vertices, MARGIN)
        inner = require_roundable(stock, part_mesh.vertices, MARGIN)
    return BegunLevels(surface, part_mesh, stock, inner, begin_morph(surface, inner, schedule, **options))


def _offsets(farthest: float, schedule: Schedule, first: int) -> list[float]:
    """Distances (mm) of the levels above level `first` from the rounded body, the last one `farthest`: as few
    as the depths allow, all of the same share of them."""
    count = 1
    while schedule.reach(first + count) - schedule.reach(first) < farthest:
        count += 1
    share = farthest / (schedule.reach(first + count) - schedule.reach(first))
    return [share * (schedule.reach(first + j) - schedule.reach(first)) for j in range(1, count + 1)]


def _measure(inner: TriangleMesh, outer: TriangleMesh, before: Stock, stock: Stock, limit: float) -> Measures:
    """The cut between two rounding levels: the depth of a point of the outer one is exactly its distance from
    the body `before`, which is that of the inner one.

    The reverse depth is no larger than the depth, as the outer level is an offset of the inner one.
    """
    fine = split_edges(outer, outer.diagonal / MAX_EDGE_SHARE)
    inner_points, outer_points = probes(inner), probes(fine)
    depth = np.maximum(before.signed_distance(outer_points), 0.0)
    nesting = -np.minimum(MeshDistance(outer).signed(inner_points), stock.signed_distance(inner_points))
    return measures_of(
        inner,
        fine,
        limit,
        inner_points=inner_points,
        outer_points=outer_points,
        depth=depth,
        outside=stock.signed_distance(outer_points),
        reverse_depth=np.full(len(inner_points), depth.max()),
        nesting=nesting,
        remaining=np.zeros(len(inner_points)),
        crossing_faces=self_intersections(outer),
    )


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
        part = PartLevel(surface, surface.tessellate(job.levels.chord_tolerance), NO_CUT)
        around = stock.mesh(job.levels.chord_tolerance)
        distance = float(MeshDistance(part.mesh).unsigned(around.vertices).max())
        levels = part, StockLevel(1, around, distance, NO_CUT)
        return Morph(levels, lower_bound=1, distance=distance, solve_seconds=0.0, check_seconds=0.0)
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
