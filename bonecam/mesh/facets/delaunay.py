"""Delaunay triangulation of points in the plane, one point after the other (Bowyer 1981, Watson 1981).

Xu et al. (2013), section 2.3, make their facets of the cutter contacts so. Outside each edge of the hull lies a
triangle whose third corner is GHOST, a vertex at infinity: unlike a triangle round all points, it loses no
facet on straight hulls, such as those of zig-zag passes. Coordinates are made whole numbers by one power of
two, so that both predicates are exact, on rows and grids too, where many points lie on one line or circle.
"""

import numpy as np
from jaxtyping import Float, Int, Int32
from numpy import ndarray

from bonecam.kernels.closest.triangle_tree import tree_order

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
    triangulation = _Triangulation(_whole(points), _insertion_order(points).tolist())
    return triangulation.faces()


def _whole(points: Float[ndarray, "n 2"]) -> list[Point]:
    """The points times one power of two that makes all coordinates whole; exact."""
    ratios = [value.as_integer_ratio() for value in points.ravel().tolist()]
    scale = max(below for _, below in ratios)
    values = [above * (scale // below) for above, below in ratios]
    return list(zip(values[::2], values[1::2]))


def _insertion_order(points: Float[ndarray, "n 2"]) -> Int[ndarray, " n"]:
    """Neighbours soon after one another, so that the search for a triangle is short."""
    leaves = 1 << (len(points) - 1).bit_length()
    order: Int[ndarray, " n"] = tree_order(np.column_stack([points, np.zeros(len(points))]), leaves)
    return order


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
        p = points[vertex]
        if c != GHOST:
            return in_circle(points[a], points[b], points[c], p)
        side = orientation(points[a], points[b], p)
        return side > 0 or (side == 0 and _between(points[a], points[b], p))

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
                self._require_new(vertex, (a, b, c))
                return a, b, c
            beyond = self.apex[end, start]
            if beyond == GHOST:
                return end, start, GHOST
            a, b, c = end, start, beyond

    def _require_new(self, vertex: int, corners: Triangle) -> None:
        for corner in corners:
            if self.points[corner] == self.points[vertex]:
                raise _equal(corner, vertex)


def _between(a: Point, b: Point, p: Point) -> bool:
    """Whether p, on the line through a and b, lies between them."""
    return (a[0] - p[0]) * (b[0] - p[0]) + (a[1] - p[1]) * (b[1] - p[1]) < 0


def _equal(one: int, other: int) -> ValueError:
    first, second = sorted((one, other))
    return ValueError(f"points {first} and {second} are equal: leave one of them out")
