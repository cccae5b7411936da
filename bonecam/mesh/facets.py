"""Facets between points: triangulation, normals, curvature, and which side of them a point is on.

Normals of a mesh's vertices.

Delaunay triangulation of points in the plane, one point after the other (Bowyer 1981, Watson 1981).

Xu et al. (2013), section 2.3, make their facets of the cutter contacts so. Outside each edge of the hull lies a
triangle whose third corner is GHOST, a vertex at infinity: unlike a triangle round all points, it loses no
facet on straight hulls, such as those of zig-zag passes. Coordinates are made whole numbers by one power of
two, so that both predicates are exact, on rows and grids too, where many points lie on one line or circle.

Principal curvatures, from the first and second fundamental forms, and the shapes they stand for.

With n the outward normal and L = -n.S_ss, M = -n.S_st, N = -n.S_tt, a curvature is positive where the part
bulges outward, towards the cutter: 1/R everywhere on a ball of radius R. (Xu et al. 2013 take the other sign:
there H < 0 is convex.)

Curvature of a triangle mesh by moving least squares (Xu et al. 2013, section 4, Eq. 18).

About each vertex, in a frame (t1, t2, n), the vertices near it are met by

    z = a x^2 + b y^2 + c x y + d x + e y + f

with weights exp(-4 (distance / farthest)^2). The frame is then turned to the patch's own normal n - d t1 - e t2
and the fit made once more. Differs from the paper in:

1. Principal curvatures are those of the patch by its two fundamental forms: the eigenvalues of its Hessian, as
   printed, hold only where d = e = 0.

Areas of the Voronoi cells of a mesh's vertices on its faces (Xu et al. 2013, Eq. 10; Meyer et al. 2003).

In a face without an obtuse angle a corner's cell goes as far as the circumcentre: the corner has an eighth of
l^2 cot(a) for each of its two sides, l long and opposite the angle a. Where an angle is obtuse the circumcentre lies
outside: its corner has half of the face, the others a quarter each.
"""

from dataclasses import dataclass
from enum import IntEnum
from itertools import permutations

import numpy as np
from jaxtyping import Float, Int, Int32
from numpy import ndarray
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.spatial import KDTree

from bonecam.arrays import dots, perpendicular, unit
from bonecam.errors import MeshError
from bonecam.kernels.closest_points import tree_order
from bonecam.mesh.triangle_mesh import TriangleMesh


def vertex_areas(mesh: TriangleMesh) -> Float[ndarray, " v"]:
    """A third of the area of the faces at each vertex, mm^2."""
    thirds = np.linalg.norm(mesh.face_vectors, axis=1) / 6
    areas = np.zeros(len(mesh.vertices))
    for k in range(3):
        np.add.at(areas, mesh.faces[:, k], thirds)
    return areas


def vertex_normals(mesh: TriangleMesh) -> Float[ndarray, "n 3"]:
    """Unit normals: the sum of the cross products of the faces round each vertex, not normalised before, so that
    each face counts by its area (Xu et al. 2013, Eq. 19).

    MeshError where a vertex has no face, or its faces cancel.
    """
    sums = np.zeros((len(mesh.vertices), 3))
    for corner in mesh.faces.T:
        np.add.at(sums, corner, mesh.face_vectors)
    lengths = np.linalg.norm(sums, axis=1)
    if len(lengths) and not lengths.min() > 0:
        vertex = int(np.argmin(lengths))
        raise MeshError(
            f"vertex {vertex} has no normal: remove vertices without faces, and faces without area", vertex=vertex
        )
    return np.asarray(sums / lengths[:, None])


GHOST = -1
"""The vertex at infinity."""

Point = tuple[int, int]
Triangle = tuple[int, int, int]


def delaunay(points: Float[ndarray, "n 2"]) -> Int32[ndarray, "m 3"]:
    """The triangles of n points, counter-clockwise; no point lies inside the circle round one of them.

    With k points on the hull, those between its corners included, there are m = 2n - 2 - k triangles. Where more
    than three points lie on an empty circle, any of the possible triangulations comes. ValueError where fewer
    than three points are given, one is not finite, two are equal, or all lie on a line.
    """
    points = np.asarray(points, dtype=np.float64)
    if len(points) < 3:
        raise ValueError(f"{len(points)} points span no triangle: give three or more")
    if not np.isfinite(points).all():
        raise ValueError(f"point {int(np.argmin(np.isfinite(points).all(axis=1)))} is not finite")
    # The points times one power of two that makes all coordinates whole; exact
    ratios = [value.as_integer_ratio() for value in points.ravel().tolist()]
    scale = max(below for _, below in ratios)
    values = [above * (scale // below) for above, below in ratios]
    leaves = 1 << (len(points) - 1).bit_length()
    order: Int[ndarray, " n"] = tree_order(np.column_stack([points, np.zeros(len(points))]), leaves)
    triangulation = _Triangulation(list(zip(values[::2], values[1::2])), order.tolist())
    return triangulation.faces()


def orientation(a: Point, b: Point, c: Point) -> int:
    """Twice the area of a, b, c: positive counter-clockwise, 0 on a line."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def in_circle(a: Point, b: Point, c: Point, p: Point) -> bool:
    """Whether p lies inside the circle round a, b, c, which run counter-clockwise."""
    ax, ay = a[0] - p[0], a[1] - p[1]
    bx, by = b[0] - p[0], b[1] - p[1]
    cx, cy = c[0] - p[0], c[1] - p[1]
    a2, b2, c2 = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    return a2 * (bx * cy - by * cx) + b2 * (cx * ay - cy * ax) + c2 * (ax * by - ay * bx) > 0


class _Triangulation:
    """Triangles by their directed edges: `apex[a, b]` is the third corner of the triangle on the left of a -> b."""

    def __init__(self, points: list[Point], order: list[int]) -> None:
        self.points = points
        self.apex: dict[tuple[int, int], int] = {}
        first = self._first_triangle(order)
        a, b, c = self.last = first
        for triangle in (first, (b, a, GHOST), (c, b, GHOST), (a, c, GHOST)):
            self._add(*triangle)
        for vertex in order:
            if vertex not in first:
                self._insert(vertex)

    def faces(self) -> Int32[ndarray, "m 3"]:
        """Each triangle once, its lowest vertex first."""
        triangles = [(a, b, c) for (a, b), c in self.apex.items() if min(a, b, c) == a and a != GHOST]
        return np.array(triangles, dtype=np.int32).reshape(-1, 3)

    def _first_triangle(self, order: list[int]) -> Triangle:
        """Two points and the first one beside their line, counter-clockwise."""
        a, b = order[:2]
        points = self.points
        if points[a] == points[b]:
            raise _equal(a, b)
        for c in order[2:]:
            side = orientation(points[a], points[b], points[c])
            if side:
                return (a, b, c) if side > 0 else (b, a, c)
        raise ValueError(f"all {len(points)} points lie on a line: there is no triangle between them")

    def _add(self, a: int, b: int, c: int) -> None:
        self.apex[a, b] = c
        self.apex[b, c] = a
        self.apex[c, a] = b

    def _insert(self, vertex: int) -> None:
        """Replace the triangles whose circles hold the point by those between it and their outline."""
        a, b, c = self._triangle_at(vertex)
        outline = [(a, b), (b, c), (c, a)]
        for edge in outline:
            del self.apex[edge]
        while outline:
            a, b = outline.pop()
            beyond = self.apex[b, a]
            if self._holds(b, a, beyond, vertex):
                for edge in ((b, a), (a, beyond), (beyond, b)):
                    del self.apex[edge]
                outline += [(a, beyond), (beyond, b)]
            else:
                self._add(vertex, a, b)
                if GHOST not in (a, b):
                    self.last = (vertex, a, b)

    def _holds(self, a: int, b: int, c: int, vertex: int) -> bool:
        """Whether the circle of a triangle holds the point: of a ghost the open half plane beyond its edge, and
        the edge."""
        points = self.points
        while GHOST in (a, b):
            a, b, c = b, c, a
        p, q, r = points[vertex], points[a], points[b]
        if c != GHOST:
            return in_circle(q, r, points[c], p)
        side = orientation(q, r, p)
        between = (q[0] - p[0]) * (r[0] - p[0]) + (q[1] - p[1]) * (r[1] - p[1]) < 0
        return side > 0 or (side == 0 and between)

    def _triangle_at(self, vertex: int) -> Triangle:
        """The triangle that the point lies in; a ghost where it lies outside all. From the triangle made last
        across each edge that has the point beyond it."""
        points = self.points
        p = points[vertex]
        a, b, c = self.last
        while True:
            for start, end in ((a, b), (b, c), (c, a)):
                if orientation(points[start], points[end], p) < 0:
                    break
            else:
                corners = (a, b, c)
                for corner in corners:
                    if self.points[corner] == self.points[vertex]:
                        raise _equal(corner, vertex)
                return a, b, c
            beyond = self.apex[end, start]
            if beyond == GHOST:
                return end, start, GHOST
            a, b, c = end, start, beyond


def _equal(one: int, other: int) -> ValueError:
    first, second = sorted((one, other))
    return ValueError(f"points {first} and {second} are equal: leave one of them out")


FLAT_SHARE = 0.05
"""A curvature below this share of the mean size of all is none."""


class SurfaceShape(IntEnum):
    """The shape of a surface round a point, by the signs of k1 >= k2."""

    CONVEX = 0
    CONCAVE = 1
    SADDLE = 2
    PARABOLIC = 3
    PLANAR = 4


@dataclass(frozen=True, eq=False)
class Curvature:
    """Principal curvatures k1 >= k2 in 1/mm (positive: bulges outward) and their unit directions."""

    k1: Float[ndarray, " n"]
    k2: Float[ndarray, " n"]
    direction1: Float[ndarray, "n 3"]
    direction2: Float[ndarray, "n 3"]

    @property
    def mean(self) -> Float[ndarray, " n"]:
        """H = (k1 + k2) / 2."""
        return (self.k1 + self.k2) / 2

    @property
    def gaussian(self) -> Float[ndarray, " n"]:
        """K = k1 k2."""
        return self.k1 * self.k2

    @property
    def shapes(self) -> Int[ndarray, " n"]:
        """The Shape of each point; a curvature is zero below FLAT_SHARE of the mean of all |k1| and |k2|."""
        flat = FLAT_SHARE * float(np.mean(np.abs([self.k1, self.k2]))) if len(self.k1) else 0.0
        sign1, sign2 = (np.where(np.abs(k) <= flat, 0, np.sign(k)) for k in (self.k1, self.k2))
        cases = [(sign1 == 0) & (sign2 == 0), (sign1 == 0) | (sign2 == 0), sign1 > sign2, sign1 > 0]
        return np.select(
            cases,
            [SurfaceShape.PLANAR, SurfaceShape.PARABOLIC, SurfaceShape.SADDLE, SurfaceShape.CONVEX],
            SurfaceShape.CONCAVE,
        )


def principal(forms: Float[ndarray, "n 2 2"], axes: Float[ndarray, "n 2 3"]) -> Curvature:
    """Principal curvatures of second forms given in orthonormal tangent axes."""
    values, vectors = np.linalg.eigh(forms)
    directions = np.einsum("nki,nkd->nid", vectors, axes)
    return Curvature(values[:, 1], values[:, 0], directions[:, 1], directions[:, 0])


def tangent_axes(normals: Float[ndarray, "n 3"], along: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2 3"]:
    """Orthonormal axes of the tangent planes, the first one in the direction of `along`."""
    first = unit(along - np.einsum("ni,ni->n", along, normals)[:, None] * normals)
    return np.stack([first, np.cross(normals, first)], axis=1)


def surface_curvature(derivatives: tuple[Float[ndarray, "n 3"], ...], normals: Float[ndarray, "n 3"]) -> Curvature:
    """Curvature where S_s and S_t are independent, from S_s, S_t, S_ss, S_st, S_tt and the outward unit
    normals."""
    S_s, S_t, S_ss, S_st, S_tt = derivatives
    axes = tangent_axes(normals, S_t)
    J = np.stack([np.einsum("nki,ni->nk", axes, S_s), np.einsum("nki,ni->nk", axes, S_t)], axis=2)
    L, M, N = (-np.einsum("ni,ni->n", normals, v) for v in (S_ss, S_st, S_tt))
    second = np.stack([np.stack([L, M], axis=1), np.stack([M, N], axis=1)], axis=1)
    inverse = np.linalg.inv(J)
    return principal(np.swapaxes(inverse, 1, 2) @ second @ inverse, axes)


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
    count = len(normals)
    # a vertex is a neighbour of its own
    itself = eye_array(count, format="csr")
    if radius is None:
        start, end = np.concatenate([mesh.faces[:, pair] for pair in permutations(range(3), 2)]).T
        edges = csr_array((np.ones(len(start)), (start, end)), shape=(count, count)) + itself
        around = edges @ edges
    else:
        # no further than `radius` apart, with normals that point to one side
        if not radius > 0:
            raise ValueError(f"radius = {radius}: give a length in mm above 0")
        tree = KDTree(mesh.vertices)
        near = tree.sparse_distance_matrix(tree, radius, output_type="coo_matrix")
        alike = dots(normals[near.row], normals[near.col]) > 0
        ends = near.row[alike], near.col[alike]
        around = csr_array((np.ones(alike.sum()), ends), shape=(count, count)) + itself
    starts = around.indptr
    few = np.flatnonzero(np.diff(starts) < COEFFICIENTS)
    if len(few) and not few_allowed:
        vertex = int(few[0])
        others = int(np.diff(starts)[few[0]]) - 1
        raise MeshError(
            f"vertex {vertex} has {others} neighbours, too few for its curvature: give a larger radius", vertex=vertex
        )
    parts = [
        _fit(
            mesh.vertices,
            normals,
            neighbours=around.indices,
            starts=starts[first : first + CHUNK + 1],
            first=first,
            few_allowed=few_allowed,
        )
        for first in range(0, count, CHUNK)
    ]
    fields = ("k1", "k2", "direction1", "direction2")
    return Curvature(*(np.concatenate([getattr(part, name) for part in parts]) for name in fields))


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
        # MeshError where all neighbours of a vertex (the first is `first`) lie on a line or at one place
        moments = np.linalg.eigvalsh(np.add.reduceat(offsets[:, :, None] * offsets[:, None, :], begins))
        narrow = np.flatnonzero(~(moments[:, 1] > NARROWEST * moments[:, 2]))
        if len(narrow):
            vertex = first + int(narrow[0])
            raise MeshError(
                f"the neighbours of vertex {vertex} lie on a line: give a larger radius, or merge equal vertices",
                vertex=vertex,
            )
    squares = dots(offsets, offsets)
    farthest = np.sqrt(np.maximum.reduceat(squares, begins))
    weights = np.exp(-FALL * squares / farthest[owner] ** 2)

    n = normals[first : first + len(farthest)]
    for _ in range(2):
        t1 = perpendicular(n)
        t2 = np.cross(n, t1)
        frame = (t1, t2, n)
        # Coefficients a .. f of each vertex; lengths are taken in `farthest`, so that all columns are alike in size
        x, y, z = (dots(offsets, axis[owner]) / farthest[owner] for axis in frame)
        columns = np.column_stack([x * x, y * y, x * y, x, y, np.ones(len(x))])
        weighted = weights[:, None] * columns
        matrices = np.add.reduceat(weighted[:, :, None] * columns[:, None, :], begins)
        right = np.add.reduceat(weighted * z[:, None], begins)
        solved = np.einsum("mij,mj->mi", np.linalg.pinv(matrices, hermitian=True), right)
        a, b, c, d, e, _ = (solved * farthest[:, None] ** np.array([-1, -1, -1, 0, 0, 1])).T
        n = unit(n - d[:, None] * t1 - e[:, None] * t2)
    t1, t2, up = frame
    first_order = (t1 + d[:, None] * up, t2 + e[:, None] * up)
    second_order = tuple(factor[:, None] * up for factor in (2 * a, c, 2 * b))
    return surface_curvature((*first_order, *second_order), n)


def voronoi_areas(mesh: TriangleMesh) -> Float[ndarray, " n"]:
    """The area (mm^2) of each vertex's cell; they add up to the area of the mesh. 0 of a vertex without faces."""
    corners = mesh.vertices[mesh.faces]
    whole = np.linalg.norm(mesh.face_vectors, axis=1)
    doubled = np.maximum(whole, np.finfo(float).tiny)
    to_next, to_last = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cosines = (to_next * to_last).sum(axis=2)
    opposite = ((to_next - to_last) ** 2).sum(axis=2) * cosines / doubled[:, None]
    acute = (opposite.sum(axis=1, keepdims=True) - opposite) / 8
    obtuse = cosines < 0
    halves = whole[:, None] / np.where(obtuse, 4, 8)
    shares = np.where(obtuse.any(axis=1, keepdims=True), halves, acute)
    return np.bincount(mesh.faces.ravel(), shares.ravel(), len(mesh.vertices))


def cotangent_weights(mesh: TriangleMesh) -> csr_array:
    """For each edge half the sum of the cotangents of the angles opposite to it: symmetric (v, v)."""
    count = len(mesh.vertices)
    corners = mesh.vertices[mesh.faces]
    starts = []
    ends = []
    cotangents = []
    for k in range(3):
        to_next = corners[:, (k + 1) % 3] - corners[:, k]
        to_last = corners[:, (k + 2) % 3] - corners[:, k]
        sines = np.linalg.norm(np.cross(to_next, to_last), axis=1)
        cotangents.append(0.5 * (to_next * to_last).sum(1) / sines)
        starts.append(mesh.faces[:, (k + 1) % 3])
        ends.append(mesh.faces[:, (k + 2) % 3])
    half = coo_array(
        (np.concatenate(cotangents), (np.concatenate(starts), np.concatenate(ends))), shape=(count, count)
    ).tocsr()
    return (half + half.T).tocsr()
