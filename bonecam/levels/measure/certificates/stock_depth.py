"""How deep the last cut is at most, from the stock down to a level.

Every point of the stock's surface is the nearest one to a point of its mesh, and no farther from it than the
mesh's faces are inside the stock. The faces are bounded as patches are (`kernels.hulls.depth`); finer meshes
decide where coarse ones leave doubt.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.kernels.hulls.depth import depth_bound
from bonecam.kernels.hulls.footpoints import DepthTarget
from bonecam.levels.measure.certificates.certificate import ROUNDING, SMALLEST
from bonecam.levels.measure.certificates.depth import depth_target
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline

CHORD_TOLERANCES = (0.02, 0.005, 0.001)
"""Chord tolerances (mm) of the stock's mesh, tried in this order until the last cut is certified."""

BOUNDED_FIRST = 50
"""So many faces of the stock's mesh, those farthest from the level, are bounded first."""

SAGITTA_PARTS = 5
"""A bound of the faces is good enough up to the sagitta divided by this; the whole sagitta is added to it."""


def bound_stock_depth(inner: TSpline, stock: Stock, limit: float) -> tuple[float, Float[ndarray, "3"], int]:
    """How far the stock's surface is from a level at most, mm; about where; how many pieces were bounded."""
    target = depth_target(inner)
    for chord_tolerance in CHORD_TOLERANCES:
        depth, place, pieces = bound_mesh_depth(target, *faces_of_stock(stock, chord_tolerance))
        if depth <= limit + DEPTH_TOLERANCE:
            break
    return depth, place, pieces


def bound_mesh_depth(
    target: DepthTarget, faces: Float[ndarray, "f 3 3"], sagitta: float
) -> tuple[float, Float[ndarray, "3"], int]:
    """How far the stock's surface, at most `sagitta` mm over these faces, is from a level at most, mm; about
    where; how many pieces were bounded."""
    middles = faces.mean(1)
    seeds = target.seeds.reshape(-1, 5)
    near, nearest_seed = (np.asarray(values) for values in cKDTree(seeds[:, 2:]).query(middles))
    order = np.argsort(-near, kind="stable")
    reach = near + np.linalg.norm(faces - middles[:, None], axis=2).max(1)
    depth = 0.0
    place = middles[order[0]]
    pieces = 0
    for part in (
        order[:BOUNDED_FIRST],
        order[BOUNDED_FIRST:],
    ):  # the bound of the first few suffices for most others
        part = part[reach[part] > depth]
        starts = np.repeat(seeds[nearest_seed[part], None, :2], 4, axis=1)
        bound, (face, _, _), _, count = depth_bound(
            triangle_nets(faces[part]),
            starts,
            on=target,
            goal=depth,
            alarm=np.inf,
            accuracy=sagitta / SAGITTA_PARTS,
            smallest=SMALLEST,
        )
        pieces += count
        if bound > depth:
            depth = bound
            place = middles[part[int(face)]]
    return depth + sagitta + ROUNDING, place, pieces


def faces_of_stock(stock: Stock, chord_tolerance: float) -> tuple[Float[ndarray, "f 3 3"], float]:
    """The corners of the faces of the stock's mesh, and how far inside the stock they are at most, mm.

    The signed distance is convex: over a face it lies above its tangent plane in the middle of the face.
    """
    mesh = stock.mesh(chord_tolerance)
    faces = mesh.vertices[mesh.faces]
    middles = faces.mean(1)
    distance, out = stock.distances_and_normals(middles)
    slope = np.einsum("fcx,fx->fc", faces - middles[:, None], out).min(1)
    return faces, max(0.0, float(-(distance + slope).min()))


def triangle_nets(faces: Float[ndarray, "f 3 3"]) -> Float[ndarray, "f 16 3"]:
    """Bicubic nets of triangles, one side of which is a point."""
    third = np.arange(4) / 3
    base = faces[:, :1] + third[:, None] * (faces[:, 1:2] - faces[:, :1])
    rows = base[:, None] + third[:, None, None] * (faces[:, 2][:, None, None] - base[:, None])
    return np.ascontiguousarray(rows.reshape(-1, 16, 3))
