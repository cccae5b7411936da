"""What a section of the tool sweeps for all axes of an elliptic cone, compiled: the vertices of a mesh that holds it.

A `size` is start and end of the section above the apex, its radius, both semi-angles of the cone, and the growth: how
far the apex may be from its place (mm, radians; `Sweep` of `planning.axes.cones.envelope` tells the bounds). The apex
lies in the origin, the axis of the cone along Z, its largest opening along X.

Rows are written number by number: sums, products and copies of whole rows bring numpy's broadcasting and the texts of
its errors, which take longer to compile than all that is computed here.
"""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit

ARC_STEP = np.radians(20.0)
"""Longest edge of those that stand for the spheres below and above, as an angle."""
LEAST_GROWTH = 1e-3
"""Growth is no less (mm), so that no face is without an area."""
RIM_STEPS = 16
"""Planes tangent to the cone for each side, of those that bound how high a point is seen."""
LEAST_ANGLE = np.radians(0.1)
"""No semi-angle is less: a cone is no plane, nor a line."""
TOUCHING = 3
"""Times that the upper facets are laid at least, each time nearer to the sphere that they stand for."""


@inner_njit()
def opening_of(size: ndarray) -> tuple[float, float]:
    """Tangents of the semi-angles."""
    return np.tan(max(size[3], LEAST_ANGLE)), np.tan(max(size[4], LEAST_ANGLE))


@inner_njit()
def _turn(first: float, second: float, number: float, sides: int) -> tuple[float, float]:
    """Cosine and sine of the turn about the axis of a side: somewhat denser where their normals turn faster."""
    even = 2 * np.pi * number / sides
    x, y = first**0.25 * np.cos(even), second**0.25 * np.sin(even)
    long = np.hypot(x, y)
    return x / long, y / long


@inner_njit()
def _middles_of(first: float, second: float, sides: int, out: ndarray) -> None:
    """Unit directions of the rim, in the middle between each side and the next."""
    for k in range(sides):
        c, s = _turn(first, second, k + 0.5, sides)
        x, y = first * c, second * s
        long = np.sqrt(x * x + y * y + 1.0)
        out[k, 0], out[k, 1], out[k, 2] = x / long, y / long, 1.0 / long


@inner_njit()
def normals_of(first: float, second: float, sides: int, out: ndarray) -> None:
    """Outward unit normals of the sides."""
    for k in range(sides):
        c, s = _turn(first, second, float(k), sides)
        x, y, z = second * c, first * s, -first * second
        long = np.sqrt(x * x + y * y + z * z)
        out[k, 0], out[k, 1], out[k, 2] = x / long, y / long, z / long


@inner_njit()
def dot(a: ndarray, b: ndarray) -> float:
    """The dot product of two vectors in space."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_njit()
def largest_product(rows: ndarray, point: ndarray) -> float:
    """The largest dot product of a row (n, 3) with a point."""
    most = -np.inf
    for k in range(len(rows)):
        most = max(most, dot(rows[k], point))
    return most


@inner_njit()
def _lean(direction: ndarray, share: float, length: float, out: ndarray) -> None:
    """A vector of a length that leans from Z by a share of the angle by which a unit vector does."""
    angle = np.arccos(min(max(direction[2], -1.0), 1.0))
    flat = length * np.sin(share * angle) / max(np.sin(angle), 1e-12)
    out[0], out[1], out[2] = flat * direction[0], flat * direction[1], length * np.cos(share * angle)


@njit(cache=True, nogil=True)
def edges_of(first: float, second: float, sides: int, wide: float, foot: ndarray, along: ndarray) -> None:
    """The edges between each side and the next: the point nearest to the apex, and the unit direction upward."""
    normals = np.empty((sides, 3))
    normals_of(first, second, sides, normals)
    for k in range(sides):
        m, n = normals[k], normals[(k + 1) % sides]
        share = wide / (1.0 + dot(m, n))
        x = m[1] * n[2] - m[2] * n[1]
        y = m[2] * n[0] - m[0] * n[2]
        z = m[0] * n[1] - m[1] * n[0]
        long = np.sqrt(x * x + y * y + z * z) * np.sign(z)
        along[k, 0], along[k, 1], along[k, 2] = x / long, y / long, z / long
        for i in range(3):
            foot[k, i] = share * (m[i] + n[i])


@inner_njit()
def _nearest_of_triangle(a: ndarray, b: ndarray, c: ndarray) -> float:
    """The least distance of a triangle, whose corners are equally far from the origin, from there."""
    u = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    v = (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    w = (v[0] - u[0], v[1] - u[1], v[2] - u[2])
    uu, vv, ww = dot(u, u), dot(v, v), dot(w, w)
    most = max(uu, vv, ww)
    if 2 * most >= uu + vv + ww:  # obtuse: the middle of the longest edge is nearest, not that of the plane
        return np.sqrt(dot(a, a) - most / 4)
    n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    return abs(dot(n, a)) / np.sqrt(dot(n, n))


@inner_njit()
def _cap_distance(rings: ndarray, radius: float) -> float:
    """The least distance of the facets between rings on a sphere of this radius, and to its pole, from its middle."""
    count, sides = rings.shape[:2]
    pole = np.zeros(3)
    pole[2] = radius
    least = np.inf
    for k in range(count):
        for j in range(sides):
            a, b = rings[k, j], rings[k, (j + 1) % sides]
            if k == count - 1:
                least = min(least, _nearest_of_triangle(pole, a, b))
                continue
            c, d = rings[k + 1, (j + 1) % sides], rings[k + 1, j]
            least = min(least, _nearest_of_triangle(a, b, c), _nearest_of_triangle(a, c, d))
    return least


@inner_njit()
def _upper(top: float, foot: ndarray, along: ndarray) -> tuple[ndarray, float]:
    """The rings from the edges of the sides to the upper pole, and the height of the pole: their facets are nowhere
    nearer than `top`."""
    sides = len(foot)
    directions = np.empty((sides, 3))
    radius = top
    turn = 0
    while True:
        lowest = 1.0
        for k in range(sides):
            up = np.sqrt(radius * radius - dot(foot[k], foot[k]))
            for i in range(3):
                directions[k, i] = (foot[k, i] + up * along[k, i]) / radius
            lowest = min(lowest, directions[k, 2])
        count = 1 + int(np.arccos(lowest) / ARC_STEP)
        rings = np.empty((count, sides, 3))
        for k in range(count):
            for j in range(sides):
                _lean(directions[j], 1.0 - k / count, radius, rings[k, j])
        nearest = _cap_distance(rings, radius)
        turn += 1
        if turn >= TOUCHING and nearest >= top:
            return rings, radius
        radius *= 1e-6 + top / nearest


@inner_njit()
def _is_below(point: ndarray, bottom: float, around: ndarray, wide: float, normals: ndarray) -> bool:
    """Whether a point is nowhere above the `bottom` (0 or less) of a section, seen along directions `around` the cone,
    nor beyond one of the sides that are `wide` from the apex."""
    return largest_product(around, point) <= bottom + 1e-9 and largest_product(normals, point) <= wide + 1e-9


@inner_njit()
def _lower_end(bottom: float, foot: ndarray, along: ndarray, normals: ndarray) -> float:
    """How far along an edge between two sides its points are seen no higher than `bottom` (above 0) along axes of the
    cone: without what it has along the outward normal of a plane tangent to the cone a point is seen no lower."""
    end = bottom  # by the normal in the middle between those of both sides, which the foot lies on
    for k in range(len(normals)):
        at, slope = dot(normals[k], foot), dot(normals[k], along)
        square = 1.0 - slope * slope
        half = at * slope
        root = half * half - square * (dot(foot, foot) - at * at - bottom * bottom)
        if square > 0 and root >= 0:
            farther = (half + np.sqrt(root)) / square
            if at + slope * farther >= 0:
                end = max(end, farther)
    return end


@njit(cache=True, nogil=True)
def swept_vertices(size: ndarray, sides: int) -> ndarray:
    """Vertices of the closed mesh with so many sides that holds what is swept, in rings from below and then the lower
    and the upper pole, as `ring_faces` joins them; none where its sides meet before they come to where it ends below,
    as in wide cones whose apex may lie above the begin of the section."""
    first, second = opening_of(size)
    growth = max(size[5], LEAST_GROWTH)
    wide = size[2] + growth
    foot, along = np.empty((sides, 3)), np.empty((sides, 3))
    edges_of(first, second, sides, wide, foot, along)
    normals = np.empty((RIM_STEPS * sides, 3))
    normals_of(first, second, RIM_STEPS * sides, normals)
    # the edges of a pyramid that holds the cone: where none of them leads upward, no axis does
    between, around = np.empty_like(normals), np.empty_like(normals)
    edges_of(first, second, RIM_STEPS * sides, 0.0, between, around)

    bottom = size[0] - growth
    lowest = np.empty(sides)
    top = np.hypot(size[2], size[1]) + growth
    for j in range(sides):
        lowest[j] = np.inf
        if bottom > 0:
            lowest[j] = _lower_end(bottom, foot[j], along[j], normals[RIM_STEPS * j : RIM_STEPS * (j + 1)])
        else:
            for m in range(len(around)):
                slope = dot(along[j], around[m])
                if slope > 0:
                    lowest[j] = min(lowest[j], (bottom - dot(foot[j], around[m])) / slope)
        # of a wide and short section the sphere would meet the edge below where that begins, or nowhere
        above = max(lowest[j], 0.0) + LEAST_GROWTH
        top = max(top, np.sqrt(dot(foot[j], foot[j]) + above * above))
    pole = np.zeros(3)
    pole[2] = bottom if bottom > 0 else bottom / around[:, 2].min()
    ends = np.empty((sides, 3))
    for j in range(sides):
        for i in range(3):
            ends[j, i] = foot[j, i] + lowest[j] * along[j, i]
    if bottom <= 0:
        beside = np.ascontiguousarray(normals[::RIM_STEPS])
        below = _is_below(pole, bottom, around, wide, beside)
        for j in range(sides):
            below = below and _is_below(ends[j], bottom, around, wide, beside)
        if not below:
            return np.empty((0, 3))
    upper, top = _upper(top, foot, along)

    widest = np.arctan(max(first, second))
    arcs = 1 + int(widest / ARC_STEP) if bottom > 0 else 0
    count = arcs + 1 + len(upper)
    vertices = np.zeros((count * sides + 2, 3))
    middles = np.empty((sides, 3))
    _middles_of(first, second, sides, middles)
    for j in range(sides):
        for k in range(arcs):
            _lean(middles[j], (k + 1) / arcs, bottom, vertices[k * sides + j])
        for i in range(3):
            vertices[arcs * sides + j, i] = ends[j, i]
            for k in range(len(upper)):
                vertices[(arcs + 1 + k) * sides + j, i] = upper[k, j, i]
    vertices[count * sides, 2] = pole[2]
    vertices[count * sides + 1, 2] = top
    return vertices
