"""Measure one cut of an open surface, between two levels over one T-mesh.

An open surface has no inside. Nesting is measured along the normals of the outer level, on the side of the part
on which the stock lies.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.levels.measure.cut_measures import CutSamples, Measures, measures_of
from bonecam.levels.measure.measured_surface import MeasuredSurface
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.surface.tspline import TSpline


def measure_open_cut(
    inner: MeasuredSurface, outer: MeasuredSurface, stock: TSpline, side: float, limit: float
) -> Measures:
    """The cut from `outer` down to `inner`; `side` is 1 where the stock lies where the normals of the part point
    and -1 on the other side, `limit` the depth of the cut, mm.

    `outside` is measured from the outer level itself, which makes it zero.
    """
    parameters = inner.parameters

    # How far points of the inner level lie behind the outer one, mm: from its mesh, and from its surface where that
    # seems negative
    closest, face = exact_closest(outer.mesh, inner.points)
    normals = outer.mesh.face_vectors[face] / lengths(outer.mesh.face_vectors[face])[:, None]
    nesting = -side * dots(inner.points - closest, normals)

    doubtful = np.flatnonzero(nesting < 0)
    points = inner.points[doubtful]
    projection = outer.surface.project(points)
    normals = outer.surface.normals(*projection.parameters.T)
    nesting[doubtful] = -side * dots(points - projection.points, normals)
    samples = CutSamples(
        outer_points=outer.points,
        inner_points=inner.points,
        depth=distances_to(inner.surface, outer.points, parameters),
        outside=np.zeros(len(outer.points)),
        reverse_depth=distances_to(outer.surface, inner.points, parameters),
        nesting=np.asarray(nesting),
        remaining=distances_to(stock, inner.points, parameters),
    )
    return measures_of(samples, inner.mesh, outer.mesh, limit, self_intersections(outer.mesh))


def distances_to(
    surface: TSpline, points: Float[ndarray, "n 3"], parameters: Float[ndarray, "n 2"]
) -> Float[ndarray, " n"]:
    """Distances (mm) of points from a surface: to their footpoints, or to its points at `parameters` where
    those are nearer than the footpoints found."""
    return np.minimum(surface.project(points).distances, lengths(points - surface.positions(*parameters.T)))
