"""Measure one cut: sample both of its levels and find depths, nesting and how far it leaves the stock.

All points are measured by few Newton steps from the parameters of the same place on the other level, which
finds distances that are true or too large. Only points that look too deep or not nested are measured again,
closely.
"""

import numpy as np

from bonecam.levels.measure.cut_measures import CutSamples, Measures, measures_of
from bonecam.levels.measure.measured_surface import MeasuredSurface
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE, NESTING_TOLERANCE, STOCK_TOLERANCE
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh, probes
from bonecam.setup.stock import Stock


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
        samples,
        inner.mesh,
        outer=outer.mesh,
        limit=limit,
        crossing_faces=crossing_faces,
        near_limits=near_limits,
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
