"""From a stock with edges to the morph: the levels that round a bar (Gan et al. 2014, section 5.2: "first
rounded to a capsule").

No T-spline with a bone's control points can follow an edge, so the morph ends at the stock rounded as far as
the part allows, B, and further levels round the stock S down to it. Level j of them is the body within
delta_j of B and inside S. From a point x of it the way to the nearest point of B stays inside the convex S,
so that x lies exactly |x - B| - delta_(j-1) from the level before: the depth of each of these cuts is delta_j
- delta_(j-1), and no fewer cuts could go from S to B. Machined is only the part of the surface at delta_j
  that lies inside S.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.closed_morph import begin_morph, require_seeds_inside, require_types
from bonecam.levels.measure import CutSamples, Level, Measures, RoundedLevel, StockLevel, measures_of, morph_surfaces
from bonecam.levels.open_morph import body_surfaces
from bonecam.levels.problem import BandedCholesky, SurfaceSamples, factorise, integration_points, samples_of, thin_plate
from bonecam.levels.sequences import BegunMorph, Morph
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.remeshing import split_edges
from bonecam.mesh.solids import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh, probes
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.setup.rounding import MARGIN, half_spaces_of, intersect, require_inside, require_roundable
from bonecam.setup.schedule import Schedule
from bonecam.setup.stock import Stock
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
        levels = _with_rounding_levels(morph, self.inner, self.stock, schedule)
        return replace(morph, levels=levels, lower_bound=self.lower_bound(schedule), distance=self.distance)


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


def _with_rounding_levels(morph: Morph, inner: Stock, stock: Stock, schedule: Schedule) -> tuple[Level, ...]:
    """All levels: those of the morph to `inner`, which gets a surface, then those that round the stock down
    to it."""
    first = morph.levels[-1]
    stock_mesh = stock.mesh(CHORD)
    farthest = float(inner.signed_distance(stock_mesh.vertices).max())
    offsets = _offsets(farthest, schedule, first.index)
    bodies = [inner, *(inner.offset(offset) for offset in offsets[:-1])]
    surfaces = body_surfaces(bodies)

    # The fit that starts at the points of the last level of the morph
    outermost = morph_surfaces(morph.levels)[-1]
    samples = samples_of(outermost, *integration_points(outermost))
    matrix = samples.N + FIT_STIFFNESS * thin_plate(outermost)
    fit = _ControlPointFit(samples, samples.R @ outermost.control_points, factorise(matrix))

    levels = list(morph.levels[:-1])
    for k, (body, surface) in enumerate(zip(bodies, surfaces, strict=True), start=first.index):
        control_points = fit.control_points(body, stock)
        if k == first.index:
            mesh, measures = first.mesh, first.measures
        else:
            half_spaces = np.vstack([half_spaces_of(stock_mesh), half_spaces_of(body.mesh(CHORD))])
            mesh = intersect(half_spaces, stock.middle)
            before = bodies[k - first.index - 1]
            measures = _measure(levels[-1].mesh, mesh, before, stock, schedule.limit(k))
        certificate = first.certificate if k == first.index else None
        limit = schedule.limit(k)
        levels.append(
            RoundedLevel(
                k,
                surface,
                mesh=mesh,
                limit=limit,
                measures=measures,
                stock=stock,
                control_points=control_points,
                certificate=certificate,
            )
        )

    k = first.index + len(bodies)
    measures = _measure(levels[-1].mesh, stock_mesh, bodies[-1], stock, schedule.limit(k))
    return *levels, StockLevel(k, stock_mesh, schedule.limit(k), measures)


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
    none_left = np.zeros(len(inner_points))
    samples = CutSamples(
        outer_points=outer_points,
        inner_points=inner_points,
        depth=depth,
        outside=stock.signed_distance(outer_points),
        reverse_depth=np.full(len(inner_points), depth.max()),
        nesting=nesting,
        remaining=none_left,
    )
    return measures_of(samples, inner, fine, limit, self_intersections(outer))


@dataclass(frozen=True, eq=False)
class _ControlPointFit:
    """A least-squares fit of control points over the T-mesh of the part: to the `points` of the last level of
    the morph at `samples`, moved outwards; `factorised` is its normal matrix."""

    samples: SurfaceSamples
    points: Float[ndarray, "n 3"]
    factorised: BandedCholesky

    def control_points(self, body: Stock, stock: Stock) -> Float[ndarray, "c 3"]:
        """Control points of a surface that follows the part of `body` inside `stock`: each point goes to the
        nearest point of the body, but no farther than to the wall of the stock, which bisection finds."""
        target = body.closest_points(self.points)
        low = np.zeros((len(self.points), 1))
        high = np.ones((len(self.points), 1))
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            inside = stock.signed_distance(self.points + middle * (target - self.points))[:, None] <= 0
            low = np.where(inside, middle, low)
            high = np.where(inside, high, middle)
        ends = self.points + high * (target - self.points)
        return self.factorised.solve(self.samples.moments(ends))
