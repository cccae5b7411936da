"""Inspect a sequence of levels: measure and certify every cut, and list those that are out of tolerance.

`measure_level` and `measure_stock` measure one cut. `inspect` measures all cuts of a sequence on one grid;
`inspect_again` measures some of them again when their levels have moved by microns, on the same grid.

Measure one cut: sample both of its levels and find depths, nesting and how far it leaves the stock.

All points are measured by few Newton steps from the parameters of the same place on the other level, which
finds distances that are true or too large. Only points that look too deep or not nested are measured again,
closely.
"""

import time
from collections.abc import Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError, SurfaceError
from bonecam.levels.measure.certificates.certify import certify_cut, certify_last_cut
from bonecam.levels.measure.certificates.nets import certifiable
from bonecam.levels.measure.cut_measures import NO_CUT, CutSamples, Measures, measures_of
from bonecam.levels.measure.grid import LevelGrid, level_grid
from bonecam.levels.measure.level import Level, MorphLevel, PartLevel, StockLevel, machined_levels
from bonecam.levels.measure.measured_surface import MeasuredSurface
from bonecam.levels.measure.violations import Violation, require_none, violations
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE, NESTING_TOLERANCE, STOCK_TOLERANCE
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh, probes
from bonecam.progress import Progress, report, silent
from bonecam.runtime.threads import cores
from bonecam.setup.schedule import Schedule
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline


def measure_cut(inner: MeasuredSurface, outer: MeasuredSurface, stock: Stock, limit: float) -> Measures:
    """The cut between two levels with surfaces over one T-mesh; `limit` is its depth, mm."""
    outside = stock.signed_distance(outer.points)
    depth = inner.distances_near(outer.points, outer.parameters)
    deep = np.flatnonzero(depth > limit)
    depth[deep] = np.abs(inner.closest(outer.points[deep], outer.parameters[deep])[0])

    nesting = -outer.signed_distances_near(inner.points, inner.parameters)
    behind = np.flatnonzero(nesting < 0)
    fallen, footpoints_behind = outer.closest(inner.points[behind], inner.parameters[behind])
    nesting[behind] = -fallen
    deep = np.flatnonzero(nesting > limit)
    nesting[deep] = -outer.closest(inner.points[deep], inner.parameters[deep])[0]

    crossing_faces = self_intersections(outer.mesh)
    too_far = (depth > limit + DEPTH_TOLERANCE / 2) | (outside > STOCK_TOLERANCE / 2)
    near_limits = np.vstack(
        [
            outer.parameters[too_far],
            inner.parameters[nesting > limit + DEPTH_TOLERANCE / 2],
            footpoints_behind[fallen > NESTING_TOLERANCE / 2],
            outer.grid.parameters[np.unique(outer.mesh.faces[crossing_faces])],
        ]
    )
    remaining = -stock.signed_distance(inner.points)
    samples = CutSamples(
        outer.points,
        inner.points,
        depth=depth,
        outside=outside,
        reverse_depth=nesting,
        nesting=nesting,
        remaining=remaining,
    )
    return measures_of(
        samples, inner.mesh, outer=outer.mesh, limit=limit, crossing_faces=crossing_faces, near_limits=near_limits
    )


def measure_last_cut(inner: MeasuredSurface, mesh: TriangleMesh, stock: Stock, limit: float) -> Measures:
    """The cut from the stock, tessellated as `mesh`, down to the last level below it; `limit` is its depth,
    mm.

    No part of it counts as cut at full depth: nothing is left above the stock.
    """
    points = probes(mesh)
    outside = stock.signed_distance(points)
    depth = np.abs(inner.closest(points)[0])
    nesting = -stock.signed_distance(inner.points)
    samples = CutSamples(
        points,
        inner.points,
        depth=depth,
        outside=outside,
        reverse_depth=nesting,
        nesting=nesting,
        remaining=np.zeros(len(nesting)),
    )
    return measures_of(samples, inner.mesh, mesh, limit, self_intersections(mesh))


MAX_DOUBTED_PLACES = 100
"""Most places of a level at which its certificate leaves depth in doubt that become samples when the level is
solved again."""


@dataclass(frozen=True, eq=False)
class Rules:
    """What levels are measured against: the stock, the depths of the cuts, how far (mm) a level may lie
    outside the next one and leave the stock, and the chord tolerance of their tessellations, mm."""

    stock: Stock
    schedule: Schedule
    nesting_tolerance: float
    stock_tolerance: float
    chord_tolerance: float

    def violations(self, level: Level) -> list[Violation]:
        """What is out of tolerance on the cut of a level."""
        return violations(
            level.measures,
            level.limit,
            level.mesh,
            nesting_tolerance=self.nesting_tolerance,
            stock_tolerance=self.stock_tolerance,
        )


@dataclass(frozen=True, eq=False)
class Inspection:
    """Levels 0 (the part) to K (the stock), measured on one grid in `seconds`."""

    grid: LevelGrid
    rules: Rules
    levels: tuple[Level, ...]
    seconds: float

    @property
    def control_points(self) -> list[Float[ndarray, "c 3"]]:
        """Control points of levels 0 to K - 1."""
        return [level.control_points for level in machined_levels(self.levels)]

    @property
    def crosses(self) -> bool:
        """Whether a level cuts itself."""
        return any(level.measures.self_intersections for level in self.levels)

    @property
    def failed(self) -> tuple[Level, ...]:
        """The levels of the cuts that are out of tolerance."""
        return tuple(level for level in self.levels[1:] if self.rules.violations(level))

    @property
    def uncertain(self) -> tuple[Level, ...]:
        """The levels of the cuts that measure well but that their certificates do not prove."""
        return tuple(
            level for level in self.levels[1:] if level.certified is False and not self.rules.violations(level)
        )

    def require_passed(self) -> None:
        """Raise LevelError for the first cut that is out of tolerance."""
        for level in self.levels[1:]:
            require_none(level.index, self.rules.violations(level), level.mesh)


def excess(level: Level) -> float:
    """By how much (mm) the worst measured place of a cut breaks depth, nesting or stock; negative where none
    does."""
    return max(level.deepest - level.limit, -level.nesting_min, level.outside)


def excess_bound(level: Level) -> float:
    """An upper bound (mm) of by how much any place of a cut breaks depth, nesting or stock, from its
    certificate; the measured excess where there is none."""
    bounds = level.certificate
    if bounds is None:
        return excess(level)
    return max(excess(level), bounds.depth - level.limit, -bounds.nesting, bounds.outside)


def trouble(levels: Iterable[Level], *, doubts: bool) -> tuple[int, float]:
    """How many faces of these levels cut others, and the largest excess, mm; with `doubts` the largest of its
    bounds instead."""
    some = list(levels)
    crossing = sum(level.measures.self_intersections for level in some)
    return crossing, max((excess_bound if doubts else excess)(level) for level in some)


def inspect(
    surface: TSpline, made: Sequence[Float[ndarray, "c 3"]], rules: Rules, progress: Progress = silent
) -> Inspection:
    """Measure the cuts of the levels with control points `made`, those of the part (`surface`) first.

    Raises LevelError where a level is creased so that it cannot be tessellated.
    """
    began = time.perf_counter()
    try:
        grid = level_grid(surface, made, rules.chord_tolerance)
    except SurfaceError as error:
        raise LevelError(f"a level is creased: {error}") from error

    part = measure_part(MeasuredSurface(surface, grid))
    unmeasured = Inspection(grid, rules, (part,), time.perf_counter() - began)
    return inspect_again(unmeasured, made, range(1, len(made) + 1), progress)


def inspect_again(
    inspection: Inspection, made: Sequence[Float[ndarray, "c 3"]], cuts: Collection[int], progress: Progress = silent
) -> Inspection:
    """The inspection with these cuts measured anew, between the levels with control points `made`; the other
    cuts stay as measured."""
    began = time.perf_counter()
    measured = {level.index: level for level in inspection.levels}
    surface = measured[0].surface
    grid = inspection.grid
    rules = inspection.rules
    assert surface is not None
    waiting = list(cuts)
    threads = cores()
    surfaces = dict[int, MeasuredSurface]()
    with ThreadPoolExecutor(threads) as pool:
        for some in (waiting[first : first + threads] for first in range(0, len(waiting), threads)):
            report(progress, some[0] / (len(made) + 1), f"checking level {some[0]}")
            needed = {j for k in some for j in (k - 1, k) if j < len(made)}
            surfaces = {
                j: surfaces.get(j) or MeasuredSurface(surface.with_control_points(made[j]), grid) for j in needed
            }
            measures = pool.map(lambda k, at=surfaces: _measure(k, at, rules), some)
            measured.update(zip(some, measures))

    levels = tuple(measured[k] for k in sorted(measured))
    return Inspection(grid, rules, levels, inspection.seconds + time.perf_counter() - began)


def with_cuts_of(inspection: Inspection, other: Inspection, cuts: Collection[int]) -> Inspection:
    """The inspection with these cuts as another one has them; those that the other lacks are left out."""
    kept = [level for level in inspection.levels if level.index not in cuts]
    taken = [level for level in other.levels if level.index in cuts]
    return replace(inspection, levels=tuple(sorted(kept + taken, key=lambda level: level.index)))


def measure_part(part: MeasuredSurface) -> PartLevel:
    """The part as level 0, with the faces of its tessellation that cut others."""
    crossing_faces = self_intersections(part.mesh)
    return PartLevel(part.surface, part.mesh, replace(NO_CUT, crossing_faces=crossing_faces))


def measure_level(k: int, inner: MeasuredSurface, outer: MeasuredSurface, rules: Rules) -> MorphLevel:
    """Level k (`outer`) with its cut down to level k - 1 (`inner`) measured, and certified where that is
    possible."""
    stock = rules.stock
    limit = rules.schedule.limit(k)
    measures = measure_cut(inner, outer, stock, limit)
    level = MorphLevel(k, outer.surface, outer.mesh, limit, measures)
    if not _certifies(inner, rules):
        return level

    proof = certify_cut(inner.surface, outer.surface, stock, limit)
    doubted = proof.too_deep[:MAX_DOUBTED_PLACES]
    if proof.nesting < -NESTING_TOLERANCE:
        nearest = outer.surface.project(proof.nesting_place[None]).parameters
        doubted = np.vstack([doubted, nearest])
    return replace(level, measures=measures.watching(doubted), certificate=proof)


def _measure(k: int, surfaces: dict[int, MeasuredSurface], rules: Rules) -> MorphLevel | StockLevel:
    """Level k measured, given the surfaces of levels k - 1 and k; the stock where level k has none."""
    if k in surfaces:
        return measure_level(k, surfaces[k - 1], surfaces[k], rules)

    # The stock as level k, the last, with its cut down to level k - 1 (`inner`) measured, and certified where that is
    # possible
    inner = surfaces[k - 1]
    stock = rules.stock
    limit = rules.schedule.limit(k)
    mesh = stock.mesh(rules.chord_tolerance)
    measures = measure_last_cut(inner, mesh, stock, limit)
    proof = certify_last_cut(inner.surface, stock, limit) if _certifies(inner, rules) else None
    return StockLevel(k, mesh, limit, measures, proof)


def _certifies(inner: MeasuredSurface, rules: Rules) -> bool:
    """Whether a certificate can be made, and says something: not where levels may lie farther outside one
    another than a certificate allows."""
    return certifiable(inner.surface) and rules.nesting_tolerance <= NESTING_TOLERANCE
