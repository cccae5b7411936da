"""Curvature of a triangle mesh by moving least squares (Xu et al. 2013, section 4, Eq. 18).

About each vertex, in a frame (t1, t2, n), the vertices near it are met by

    z = a x^2 + b y^2 + c x y + d x + e y + f

with weights exp(-4 (distance / farthest)^2). The frame is then turned to the patch's own normal n - d t1 - e t2
and the fit made once more. Differs from the paper in:

1. Principal curvatures are those of the patch by its two fundamental forms: the eigenvalues of its Hessian, as
   printed, hold only where d = e = 0.
"""

from itertools import permutations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import csr_array, eye_array
from scipy.spatial import KDTree

from bonecam.arrays import dots, perpendicular, unit
from bonecam.errors import MeshError
from bonecam.mesh.facets.curvature import Curvature, surface_curvature
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh

COEFFICIENTS = 6
"""Of a quadratic patch: so many vertices determine it."""
FALL = 4.0
"""The weight of the farthest vertex is exp(-FALL)."""
NARROWEST = 1e-12
"""Neighbours lie on a line if their second principal moment is less than this share of the first: a millionth of their
length."""
CHUNK = 4096
"""Vertices that are fitted at once: it bounds the memory."""


def mls_curvature(mesh: TriangleMesh, radius: float | None = None, *, few_allowed: bool = False) -> Curvature:
    """Principal curvatures and directions at the vertices.

    Each patch is fitted to the vertices within two edges, or within `radius` (mm) where the normals are less
    than a right angle apart: 2.5 edges or more. MeshError where a vertex has too few neighbours for a patch,
    or all of them lie on a line or where the vertex is; where that is allowed it gets of all patches through them the
    one with the least coefficients.
    """
    normals = vertex_normals(mesh)
    around = _within_two_edges(mesh) if radius is None else _within(mesh, normals, radius)
    starts = np.searchsorted(around[0], np.arange(len(normals) + 1))
    few = np.flatnonzero(np.diff(starts) < COEFFICIENTS)
    if len(few) and not few_allowed:
        vertex = int(few[0])
        count = int(np.diff(starts)[few[0]]) - 1
        raise MeshError(
            f"vertex {vertex} has {count} neighbours, too few for its curvature: give a larger radius", vertex=vertex
        )
    parts = [
        _fit(
            mesh.vertices,
            normals,
            neighbours=around[1],
            starts=starts[first : first + CHUNK + 1],
            first=first,
            few_allowed=few_allowed,
        )
        for first in range(0, len(normals), CHUNK)
    ]
    fields = ("k1", "k2", "direction1", "direction2")
    return Curvature(*(np.concatenate([getattr(part, name) for part in parts]) for name in fields))


def _within_two_edges(mesh: TriangleMesh) -> Int[ndarray, "2 p"]:
    """Pairs (vertex, neighbour) in the order of the vertices, each vertex its own neighbour too."""
    count = len(mesh.vertices)
    start, end = np.concatenate([mesh.faces[:, pair] for pair in permutations(range(3), 2)]).T
    edges = csr_array((np.ones(len(start)), (start, end)), shape=(count, count)) + eye_array(count, format="csr")
    return _pairs(edges @ edges)


def _within(mesh: TriangleMesh, normals: Float[ndarray, "n 3"], radius: float) -> Int[ndarray, "2 p"]:
    """Pairs (vertex, neighbour) no further than `radius` apart whose normals point to one side."""
    if not radius > 0:
        raise ValueError(f"radius = {radius}: give a length in mm above 0")
    tree = KDTree(mesh.vertices)
    near = tree.sparse_distance_matrix(tree, radius, output_type="coo_matrix")
    start, end = near.row, near.col
    alike = dots(normals[start], normals[end]) > 0
    count = len(normals)
    adjacency = csr_array((np.ones(alike.sum()), (start[alike], end[alike])), shape=(count, count))
    return _pairs(adjacency + eye_array(count, format="csr"))


def _pairs(matrix: csr_array) -> Int[ndarray, "2 p"]:
    """Rows and columns of the entries, row by row."""
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    return np.stack([rows, matrix.indices])


def _fit(
    vertices: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    neighbours: Int[ndarray, " p"],
    starts: Int[ndarray, " m"],
    first: int,
    few_allowed: bool,
) -> Curvature:
    """Curvature of the vertices from `first` on, whose neighbours begin at `starts`."""
    owner = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    offsets = vertices[neighbours[starts[0] : starts[-1]]] - vertices[first + owner]
    begins = starts[:-1] - starts[0]
    if not few_allowed:
        _require_wide(offsets, begins, first)
    squares = dots(offsets, offsets)
    farthest = np.sqrt(np.maximum.reduceat(squares, begins))
    weights = np.exp(-FALL * squares / farthest[owner] ** 2)

    n = normals[first : first + len(farthest)]
    for _ in range(2):
        t1 = perpendicular(n)
        t2 = np.cross(n, t1)
        a, b, c, d, e, _ = _patches(
            offsets, weights, farthest=farthest, owner=owner, begins=begins, frame=(t1, t2, n)
        ).T
        frame = (t1, t2, n)
        n = unit(n - d[:, None] * t1 - e[:, None] * t2)
    t1, t2, up = frame
    first_order = (t1 + d[:, None] * up, t2 + e[:, None] * up)
    second_order = tuple(factor[:, None] * up for factor in (2 * a, c, 2 * b))
    return surface_curvature((*first_order, *second_order), n)


def _require_wide(offsets: Float[ndarray, "p 3"], begins: Int[ndarray, " m"], first: int) -> None:
    """MeshError where all neighbours of a vertex (the first is `first`) lie on a line or at one place."""
    moments = np.linalg.eigvalsh(np.add.reduceat(offsets[:, :, None] * offsets[:, None, :], begins))
    narrow = np.flatnonzero(~(moments[:, 1] > NARROWEST * moments[:, 2]))
    if len(narrow):
        vertex = first + int(narrow[0])
        raise MeshError(
            f"the neighbours of vertex {vertex} lie on a line: give a larger radius, or merge equal vertices",
            vertex=vertex,
        )


def _patches(
    offsets: Float[ndarray, "p 3"],
    weights: Float[ndarray, " p"],
    farthest: Float[ndarray, " m"],
    owner: Int[ndarray, " p"],
    begins: Int[ndarray, " m"],
    frame: tuple[Float[ndarray, "m 3"], Float[ndarray, "m 3"], Float[ndarray, "m 3"]],
) -> Float[ndarray, "m 6"]:
    """Coefficients a .. f of each vertex; lengths are taken in `farthest`, so that all columns are alike in
    size."""
    size = farthest[owner]
    x, y, z = (dots(offsets, axis[owner]) / size for axis in frame)
    columns = np.column_stack([x * x, y * y, x * y, x, y, np.ones(len(x))])
    weighted = weights[:, None] * columns
    matrices = np.add.reduceat(weighted[:, :, None] * columns[:, None, :], begins)
    right = np.add.reduceat(weighted * z[:, None], begins)
    solved = np.einsum("mij,mj->mi", np.linalg.pinv(matrices, hermitian=True), right)
    powers = np.array([-1, -1, -1, 0, 0, 1])
    return np.asarray(solved * farthest[:, None] ** powers)
