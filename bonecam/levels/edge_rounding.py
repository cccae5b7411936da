"""From a stock with edges to the morph: the levels that round a bar (Gan et al. 2014, section 5.2: "first
rounded to a capsule").

No T-spline with a bone's control points can follow an edge, so the morph ends at the stock rounded as far as
the part allows, B, and further levels round the stock S down to it. Level j of them is the body within
delta_j of B and inside S. From a point x of it the way to the nearest point of B stays inside the convex S,
so that x lies exactly |x - B| - delta_(j-1) from the level before: the depth of each of these cuts is delta_j
- delta_(j-1), and no fewer cuts could go from S to B. Machined is only the part of the surface at delta_j
  that lies inside S.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.body_surface import body_surfaces
from bonecam.levels.closed_morph import Morph, morph, require_seeds_inside, require_types
from bonecam.levels.measure.check import BINS
from bonecam.levels.measure.level import Level
from bonecam.levels.problem.factorisation import factorise
from bonecam.levels.problem.samples import integration_points, samples_of, thin_plate
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.remeshing import split_edges
from bonecam.mesh.triangle_mesh import TriangleMesh, probes
from bonecam.setup.containment import MARGIN, require_inside
from bonecam.setup.rounding.half_spaces import half_spaces_of, intersect
from bonecam.setup.rounding.largest_rounding import require_roundable
from bonecam.setup.schedule import Schedule
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline
from bonecam.threads import on_one_blas_thread

CHORD, FIT_STIFFNESS, HALVINGS = 0.02, 1e-7, 30
SHARES = 100
"""Shares of a level's area are taken over edges that are this part of its diagonal at most: its flat faces
are few and large."""


@on_one_blas_thread
def levels_in(surface: TSpline, stock: Stock, schedule: Schedule, **options: Any) -> Morph:
    """The morph from the part to any stock, with the levels that round a stock with edges; `options` as in
    `morph`.

    Raises StockError where the part leaves the stock or comes so near to its edges that they cannot be
    rounded over it.
    """
    require_types(surface, schedule, stock)
    if not stock.has_edges:
        return morph(surface, stock, schedule, **options)
    require_seeds_inside(stock, surface)
    part_mesh = surface.tessellate(CHORD)
    require_inside(stock, part_mesh.vertices, MARGIN)
    inner = require_roundable(stock, part_mesh.vertices, MARGIN)
    made = morph(surface, inner, schedule, **options)
    distance = _farthest(stock.mesh(CHORD).vertices, surface, part_mesh)
    deepest = -float(stock.signed_distance(part_mesh.vertices).min())
    return replace(
        made,
        levels=rounding(made, inner, stock, schedule),
        lower_bound=schedule.lower_bound(max(distance, deepest)),
        distance=distance,
    )


def _farthest(points: Float[ndarray, "n 3"], surface: TSpline, mesh: TriangleMesh) -> float:
    """The largest distance of the points from the surface, mm; its mesh within CHORD tells which may have
    it."""
    distances = MeshDistance(mesh).unsigned(points)
    return float(surface.project(points[distances >= distances.max() - 2 * CHORD]).distances.max())


def rounding(made: Morph, inner: Stock, stock: Stock, schedule: Schedule) -> tuple[Level, ...]:
    """All levels: those of the morph to `inner`, which gets a surface, then those that round the stock down
    to it."""
    outermost = made.levels[-2].surface
    assert outermost is not None
    nets, corners, first = _Nets(outermost), stock.mesh(CHORD), made.levels[-1]
    deltas = _deltas(float(inner.signed_distance(corners.vertices).max()), schedule, first.index)
    bodies = [inner, *(inner.offset(delta) for delta in deltas)]
    shapes = body_surfaces(bodies[:-1])
    levels = [
        *made.levels[:-1],
        replace(first, surface=shapes[0], within=stock, shared=nets.of(inner, stock)),
    ]
    for j, (before, body) in enumerate(pairwise(bodies), start=1):
        k, last = first.index + j, j == len(deltas)
        mesh = (
            corners
            if last
            else intersect(
                np.vstack([half_spaces_of(corners), half_spaces_of(body.mesh(CHORD))]), stock.middle
            )
        )
        surfaces = {} if last else {"surface": shapes[j], "shared": nets.of(body, stock)}
        levels.append(_level(k, mesh, levels[-1].mesh, before, stock, schedule.limit(k), surfaces))
    return tuple(levels)


def _deltas(whole: float, schedule: Schedule, first: int) -> list[float]:
    """Distances from the rounded body, the last is `whole`: as few as the depths allow, none of them a
    sliver."""
    count = 1
    while schedule.reach(first + count) - schedule.reach(first) < whole:
        count += 1
    share = whole / (schedule.reach(first + count) - schedule.reach(first))
    return [share * (schedule.reach(first + j) - schedule.reach(first)) for j in range(1, count + 1)]


def _level(
    k: int,
    mesh: TriangleMesh,
    inner: TriangleMesh,
    before: Stock,
    stock: Stock,
    limit: float,
    surfaces: dict[str, Any],
) -> Level:
    """A rounding level: the depth at x is exactly its distance from the body before."""
    depth, fine = (
        np.maximum(before.signed_distance(probes(mesh)), 0.0),
        split_edges(mesh, mesh.diagonal / SHARES),
    )
    middles, area = (
        np.maximum(before.signed_distance(fine.vertices[fine.faces].mean(1)), 0.0),
        np.linalg.norm(fine.face_vectors, axis=1),
    )
    cut = middles > limit / 1000
    histogram = np.histogram(middles, bins=BINS, range=(0, limit), weights=area / area.sum())[0]
    nesting = -float(
        np.minimum(MeshDistance(mesh).signed(probes(inner)), stock.signed_distance(probes(inner))).max()
    )
    return Level(
        k,
        surfaces.get("surface"),
        mesh,
        limit,
        float(depth.max()),
        float(np.average(middles, weights=area)),
        nesting,
        len(self_intersections(mesh)),
        depth_back_max=float(depth.max()),
        full_mean=float(np.average(middles[cut], weights=area[cut])) if cut.any() else 0.0,
        outside=float(stock.signed_distance(probes(mesh)).max()),
        histogram=tuple(float(v) for v in histogram),
        within=stock if surfaces else None,
        shared=surfaces.get("shared"),
    )


class _Nets:
    """Control points over the part's own T-mesh for bodies round the last level of the morph: what is left is
    followed on them."""

    def __init__(self, outermost: TSpline) -> None:
        samples = samples_of(outermost, *integration_points(outermost))
        self._samples, self._points = samples, samples.R @ outermost.control_points
        self._factor = factorise(samples.N + FIT_STIFFNESS * thin_plate(outermost))

    def of(self, body: Stock, stock: Stock) -> Float[ndarray, "c 3"]:
        """Least squares to where the ways straight out of the last level meet `body`, or before that
        `stock`."""
        foot, target = self._points, body.closest_points(self._points)
        low, high = np.zeros((len(foot), 1)), np.ones((len(foot), 1))
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            inside = stock.signed_distance(foot + middle * (target - foot))[:, None] <= 0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return np.asarray(self._factor.solve(self._samples.moments(foot + high * (target - foot))))
