"""Convex polyhedra as intersections of half-spaces n . x + d <= 0, rows (n, d) of an array (k, 4)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from bonecam.mesh.facets.hull import convex_hull
from bonecam.mesh.triangle_mesh import TriangleMesh

COPLANAR = 1e-7
"""Planes are one where unit normals and offsets (mm) agree to this, which is the rounding of a hull's planes."""
MERGED = 0.01
"""Corners of an offset body nearer to each other than this, mm, are one: the slivers between them make
distances take three times as long."""
MERGED_SHARE = 0.1
"""MERGED is at most this share of the radius of the largest ball inside the offset body."""


def half_spaces_of(mesh: TriangleMesh) -> Float[ndarray, "k 4"]:
    """The half-spaces of a convex mesh's faces, outward unit normals, coplanar faces once."""
    return _first_of_cells(np.asarray(ConvexHull(mesh.vertices).equations), COPLANAR)


def deepest_point(planes: Float[ndarray, "k 4"]) -> tuple[Float[ndarray, "3"], float]:
    """Centre and radius of the largest ball inside half-spaces with unit normals; negative where none is.

    The linear program max r, n . x + r <= -d (the Chebyshev centre: Boyd & Vandenberghe 2004, section 4.3.1).
    """
    A = np.column_stack([planes[:, :3], np.ones(len(planes))])
    solution = linprog([0, 0, 0, -1], A_ub=A, b_ub=-planes[:, 3], bounds=[(None, None)] * 4)
    ball = np.asarray(solution.x, dtype=np.float64)
    return ball[:3], float(ball[3])


def intersect(planes: Float[ndarray, "k 4"], inside: Float[ndarray, "3"]) -> TriangleMesh:
    """The closed outward mesh of the intersection of half-spaces, given a point strictly inside."""
    return convex_hull(_corners(planes, inside))


def offset_polyhedron(mesh: TriangleMesh, distance: float) -> TriangleMesh:
    """The convex mesh with its faces moved outwards by `distance` mm, corners nearer than MERGED merged."""
    planes = half_spaces_of(mesh)
    moved = np.column_stack([planes[:, :3], planes[:, 3] - distance])
    inside, depth = deepest_point(moved)
    corners = _first_of_cells(_corners(moved, inside), min(MERGED, MERGED_SHARE * depth))
    return convex_hull(corners)


def _first_of_cells(rows: Float[ndarray, "n d"], cell: float) -> Float[ndarray, "m d"]:
    """The first of the rows that lie in one cell of a grid of this width."""
    _, first = np.unique(np.round(rows / cell), axis=0, return_index=True)
    return rows[np.sort(first)]


def _corners(planes: Float[ndarray, "k 4"], inside: Float[ndarray, "3"]) -> Float[ndarray, "n 3"]:
    return np.asarray(HalfspaceIntersection(planes, inside).intersections)
