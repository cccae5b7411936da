"""Bounds that hold between the points, compiled: a bicubic patch lies in the convex hull of its Bezier control points.

A net is the 16 control points (16, 3) of a bicubic Bezier patch, s fastest. The nets of its halves (de Casteljau's
algorithm at 1/2) are closer to the patch, so nets are halved until their bounds are good enough: what separates the
hulls of two nets separates their patches, and how far a patch is at most from a surface is bounded by the distance of
its net from one point, or along a map of the patch's parameters.

The map is bilinear and takes the corners of the patch to footpoints of theirs on the surface. The difference of the
patch and the image of the map is a polynomial of degree six in both parameters, no larger anywhere than the largest of
its control points. Where the map leaves one element of the surface, that element's polynomial is extended, and a bound
of what the extension is off there is added. The bound is true whatever the map; good footpoints make it tight. They are
found from parameters near them, the nearest of all from seeds all over the surface.

Where rays lie in a convex polyhedron the planes of the faces that a ray passes bound it. Every face is drawn in the
grid of the rays. A plane of another face than the one that a ray passes bounds the body too, so that rays through an
edge, which count to both faces, take no harm. Of any other polyhedron the crossings with all faces are listed, an edge
belonging to one of its two.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import CONTRACT, inner_njit, njit
from bonecam.kernels.bezier import bernstein, locate_one
from bonecam.kernels.closest_points import descend, squared_box_distance
from bonecam.kernels.rays import TILE, TINY
from bonecam.kernels.vectors import Three, cross, distance, minus

STACK_SIZE = 128
"""Room for nets on the stack of one search that halves them: one net for each halving of the first, and one
more."""


@njit(cache=True)
def halve(net: ndarray, axis: int, low: ndarray, high: ndarray) -> None:
    """Write the two halves of a net along s (axis 0) or t (1) into `low` and `high`; `low` may be the net
    itself."""
    step, other = (1, 4) if axis == 0 else (4, 1)
    for k in range(4):
        a = k * other
        b, c, d = a + step, a + 2 * step, a + 3 * step
        for x in range(3):
            pq, qr, rs = (0.5 * (net[a, x] + net[b, x]), 0.5 * (net[b, x] + net[c, x]), 0.5 * (net[c, x] + net[d, x]))
            pqr, qrs = 0.5 * (pq + qr), 0.5 * (qr + rs)
            middle = 0.5 * (pqr + qrs)
            first = net[a, x]
            last = net[d, x]
            low[a, x], low[b, x], low[c, x], low[d, x] = first, pq, pqr, middle
            high[a, x], high[b, x], high[c, x], high[d, x] = middle, qrs, rs, last


@njit(cache=True)
def copy(source: ndarray, target: ndarray) -> None:
    """Copy the rows of one array into another (slices would compile for seconds)."""
    for i in range(source.shape[0]):
        for x in range(source.shape[1]):
            target[i, x] = source[i, x]


@njit(inline="always")
def _distance(net: ndarray, a: int, b: int) -> float:
    """Distance of two control points of a net."""
    return distance(net[b], net[a])


@inner_njit()
def extents(net: ndarray) -> tuple[float, float]:
    """Length of the longest of a net's four polygons along s, and of those along t."""
    s = t = 0.0
    for k in range(4):
        s = max(
            s,
            _distance(net, 4 * k, 4 * k + 1)
            + _distance(net, 4 * k + 1, 4 * k + 2)
            + _distance(net, 4 * k + 2, 4 * k + 3),
        )
        t = max(t, _distance(net, k, 4 + k) + _distance(net, 4 + k, 8 + k) + _distance(net, 8 + k, 12 + k))
    return s, t


@inner_njit()
def box_of(net: ndarray, box: ndarray) -> None:
    """Write the lowest x, y, z and the highest x, y, z of a net into `box` (6,)."""
    for x in range(3):
        box[x] = box[3 + x] = net[0, x]
        for i in range(1, 16):
            box[x], box[3 + x] = min(box[x], net[i, x]), max(box[3 + x], net[i, x])


EDGE = 1e-9
"""A ray that passes a face outside by this share of its area passes it."""


@inner_njit()
def _rays_over(a: float, b: float, c: float, cell: float, count: int) -> tuple[int, int]:
    """The first and the last of `count` rows of rays, `cell` (mm) apart, that a triangle with these corners covers."""
    first = max(int(np.ceil(min(a, b, c) / cell - 0.5)), 0)
    return first, min(int(np.floor(max(a, b, c) / cell - 0.5)), count - 1)


@njit(inline="always")
def _orientation(a: ndarray, b: ndarray, p: ndarray) -> float:
    """Twice the area of the triangle a b p in u and v, positive where p is to the left of the way from a to b."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


@njit(cache=True, nogil=True)
def polyhedron_chords(corners: ndarray, cell: float, tile_of: ndarray, low: ndarray, high: ndarray) -> None:
    """Raise `low` and lower `high` (tiles, rays of a tile) to where rays enter and leave a convex polyhedron: w, mm.
    `corners` (f, 3, 3) are those of its triangles, outwards, in u, v, w; `tile_of` numbers the tiles of a set of rays.
    A ray that passes no triangle keeps what it has."""
    rows, columns = TILE * tile_of.shape[0], TILE * tile_of.shape[1]
    for f in range(len(corners)):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        nu, nv, nw = cross(minus(b, a), minus(c, a))
        if nw * nw <= TINY * (nu * nu + nv * nv):
            continue
        first, last = _rays_over(a[0], b[0], c[0], cell, rows)
        left, right = _rays_over(a[1], b[1], c[1], cell, columns)
        for i in range(first, last + 1):
            u = (i + 0.5) * cell
            for j in range(left, right + 1):
                tile = tile_of[i // TILE, j // TILE]
                ray = j % TILE * TILE + i % TILE
                v = (j + 0.5) * cell
                one, two = _orientation(a, b, (u, v)), _orientation(b, c, (u, v))
                three = nw - one - two
                if tile < 0 or min(one / nw, two / nw, three / nw) < -EDGE:
                    continue
                w = a[2] - (nu * (u - a[0]) + nv * (v - a[1])) / nw
                if nw < 0.0:
                    low[tile, ray] = max(low[tile, ray], w)
                else:
                    high[tile, ray] = min(high[tile, ray], w)


@njit(cache=True, nogil=True)
def find_crossings(
    corners: ndarray, cell: float, rows: int, columns: int, ray: ndarray, w: ndarray, into: ndarray
) -> int:
    """Write the number `ray` = i columns + j, the place `w` (mm) and the sense `into` (1 into a body, -1 out of it) of
    each crossing, as far as there is room, and return how many there are.

    `corners` (f, 3, 3) are those of triangles, outwards, in u, v, w; ray (i, j) lies at u = (i + 1/2) `cell`, v = (j +
    1/2) `cell`. An edge belongs to one of the two triangles beside it: the side of an edge is found from its lower end,
    so both find the same.
    """
    crossings = 0
    for f in range(len(corners)):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        area = _orientation(a, b, c)
        if area == 0.0:
            continue
        first, last = _rays_over(a[0], b[0], c[0], cell, rows)
        left, right = _rays_over(a[1], b[1], c[1], cell, columns)
        for i in range(first, last + 1):
            u = (i + 0.5) * cell
            for j in range(left, right + 1):
                p = u, (j + 0.5) * cell
                one, two, three = _left_of(a, b, p), _left_of(b, c, p), _left_of(c, a, p)
                if one != two or two != three:
                    continue
                if crossings < len(ray):
                    to_b, to_c = _orientation(a, p, c), _orientation(a, b, p)
                    ray[crossings] = i * columns + j
                    w[crossings] = a[2] + (to_b * (b[2] - a[2]) + to_c * (c[2] - a[2])) / area
                    into[crossings] = -1 if area > 0.0 else 1
                crossings += 1
    return crossings


@inner_njit()
def _left_of(a: ndarray, b: ndarray, p: tuple[float, float]) -> bool:
    """Whether a point is to the left of the edge from a to b; of one and the same edge the two ways answer unlike."""
    back = b[0] < a[0] or (b[0] == a[0] and b[1] < a[1])
    low, high = (b, a) if back else (a, b)
    return (_orientation(low, high, p) > 0.0) != back


FINITE = {"nnan", "nsz", "reassoc", "contract"}
"""What LLVM may assume of sums of finite numbers: any order, fused products, no NaN, no signed zero."""


@njit(inline="always")
def _box_separation(a: ndarray, b: ndarray) -> float:
    """Distance of two boxes along the axis on which it is largest; negative where they overlap."""
    gap = max(b[0] - a[3], a[0] - b[3])
    gap = max(gap, max(b[1] - a[4], a[1] - b[4]))
    return max(gap, max(b[2] - a[5], a[2] - b[5]))


@njit(inline="always")
def _separation_along(a: ndarray, b: ndarray, x: float, y: float, z: float) -> float:
    """Distance of two nets along a direction, whichever comes first; negative where they overlap."""
    size = math.sqrt(x * x + y * y + z * z)
    if size == 0.0:
        return -np.inf
    low_a = low_b = np.inf
    high_a = high_b = -np.inf
    for i in range(16):
        p, q = x * a[i, 0] + y * a[i, 1] + z * a[i, 2], x * b[i, 0] + y * b[i, 1] + z * b[i, 2]
        low_a, high_a, low_b, high_b = min(low_a, p), max(high_a, p), min(low_b, q), max(high_b, q)
    return max(low_b - high_a, low_a - high_b) / size


@njit(inline="always")
def _diagonals_normal(net: ndarray) -> Three:
    """The cross product of a net's two diagonals, not of unit length."""
    a, b, c = net[15, 0] - net[0, 0], net[15, 1] - net[0, 1], net[15, 2] - net[0, 2]
    d, e, f = net[12, 0] - net[3, 0], net[12, 1] - net[3, 1], net[12, 2] - net[3, 2]
    return b * f - c * e, c * d - a * f, a * e - b * d


@inner_njit(fastmath=FINITE)
def _net_separation(a: ndarray, b: ndarray, enough: float) -> float:
    """A distance that the hulls of two nets have at least, from planes across a few directions: the normal of
    either net, of both, and the line of their middles. The search ends where the distance is `enough`."""
    x, y, z = _diagonals_normal(a)
    gap = _separation_along(a, b, x, y, z)
    if gap >= enough:
        return gap
    u, v, w = _diagonals_normal(b)
    gap = max(gap, _separation_along(a, b, u, v, w))
    if gap >= enough:
        return gap
    p, q = math.sqrt(x * x + y * y + z * z), math.sqrt(u * u + v * v + w * w)
    if p > 0.0 and q > 0.0:
        gap = max(gap, _separation_along(a, b, x / p + u / q, y / p + v / q, z / p + w / q))
        if gap >= enough:
            return gap
    x = y = z = 0.0
    for i in range(16):
        x, y, z = x + b[i, 0] - a[i, 0], y + b[i, 1] - a[i, 1], z + b[i, 2] - a[i, 2]
    return max(gap, _separation_along(a, b, x, y, z))


@njit(cache=True, nogil=True)
def separation(
    inner: ndarray, outer: ndarray, goal: float, enough: float, small: float, smallest: float, most: int
) -> tuple[float, ndarray, int]:  # fmt: skip
    """A distance (mm) that two sets of patches, given by their nets (n, 16, 3), have at least, up to `goal`;
    the point of `inner` near which that is; and how many pairs of pieces were compared.

    Pieces are halved until their hulls are `goal` apart, or no larger than `small` and more than `enough`
    apart, or no larger than `smallest` (all mm). Where such pieces still overlap, or `most` pairs have been
    compared, the surfaces may meet: then the distance is negative.
    """
    a_boxes, b_boxes = np.empty((len(inner), 6)), np.empty((len(outer), 6))
    for i in range(len(inner)):
        box_of(inner[i], a_boxes[i])
    for j in range(len(outer)):
        box_of(outer[j], b_boxes[j])
    A = np.empty((STACK_SIZE, 16, 3))
    B = np.empty((STACK_SIZE, 16, 3))
    a_box = np.empty(6)
    b_box = np.empty(6)
    least = goal
    place = np.zeros(3)
    count = 0
    for i in range(len(inner)):
        for j in range(len(outer)):
            if _box_separation(a_boxes[i], b_boxes[j]) >= goal:
                continue
            copy(inner[i], A[0])
            copy(outer[j], B[0])
            height = 1
            while height:
                height -= 1
                a, b = A[height], B[height]
                box_of(a, a_box)
                box_of(b, b_box)
                gap = _box_separation(a_box, b_box)
                if gap >= least:
                    continue
                count += 1
                gap = max(gap, _net_separation(a, b, least))
                if gap >= least:
                    continue
                a_s, a_t = extents(a)
                b_s, b_t = extents(b)
                size = max(max(a_s, a_t), max(b_s, b_t))
                if (gap > enough and size <= small) or size <= smallest or height + 2 > STACK_SIZE or count >= most:
                    least = gap
                    for x in range(3):
                        place[x] = 0.25 * (a[0, x] + a[3, x] + a[12, x] + a[15, x])
                    if least < 0.0:
                        return least, place, count
                    continue
                if max(a_s, a_t) >= max(b_s, b_t):
                    halve(a, 0 if a_s >= a_t else 1, A[height], A[height + 1])
                    copy(b, B[height + 1])
                else:
                    halve(b, 0 if b_s >= b_t else 1, B[height], B[height + 1])
                    copy(a, A[height + 1])
                height += 2
    return least, place, count


class DepthTarget(NamedTuple):
    """The surface that depths are measured to, as `descend` takes it: patches (e, 16, 4) whose weights are all one,
    over `boxes` in `strips`, s closed with the period 1. `seeds` (e, k, 5) are s, t, x, y, z of points on each element;
    `hulls` (e, 6) are boxes round its elements, lowest x, y, z first."""

    patches: ndarray
    boxes: ndarray
    strips: tuple[ndarray, ...]
    domain: ndarray
    period: ndarray
    poles: ndarray
    limit: ndarray
    seeds: ndarray
    hulls: ndarray


@inner_njit()
def footpoint(point: ndarray, s: float, t: float, on: DepthTarget, D: ndarray) -> Three:
    """Parameters of the footpoint of a point reached from (s, t), and its distance (mm). The footpoint's s is
    moved on by whole turns to within half a turn of the start. A start at a pole is returned as it is, at an
    infinite distance: its s is a direction. `D` (6, 3) is overwritten."""
    if (on.poles[0] and t <= on.domain[1, 0]) or (on.poles[1] and t >= on.domain[1, 1]):
        return s, t, np.inf
    a, b, half = descend(on.patches, on.boxes, on.strips, on.domain, on.period, on.poles, on.limit, point, s, t, D)
    return a + math.floor(s - a + 0.5), b, math.sqrt(2.0 * half)


@inner_njit()
def nearest_footpoint(point: ndarray, s: float, t: float, on: DepthTarget, D: ndarray) -> Three:
    """Parameters and distance (mm) of the nearest footpoint found from (s, t) and from the nearest seed of
    every element whose box is nearer than the best footpoint so far. `D` (6, 3) is overwritten."""
    s, t, distance = footpoint(point, s, t, on, D)
    for e in range(len(on.seeds)):
        if math.sqrt(squared_box_distance(point, on.hulls, e)) >= distance:
            continue
        best = np.inf
        k = 0
        for i in range(on.seeds.shape[1]):
            x, y, z = on.seeds[e, i, 2] - point[0], on.seeds[e, i, 3] - point[1], on.seeds[e, i, 4] - point[2]
            if x * x + y * y + z * z < best:
                best = x * x + y * y + z * z
                k = i
        u, v, other = footpoint(point, on.seeds[e, k, 0], on.seeds[e, k, 1], on, D)
        if other < distance:
            s, t, distance = u, v, other
    return s, t, distance


SAMPLES = 7
"""Places along a side at which the difference is taken: as many as a polynomial of degree six has control
points."""

WIDEST_MAP = 0.4
"""Turns in s: footpoints of corners that are farther apart lie round a pole."""

NARROWEST_MAP = 1e-9
"""Half the width in s or t (both from 0 to 1) that a map to a line is given."""

UNIT_BOX = np.array([0.0, 1.0, 0.0, 1.0])
"""The box of a net's own parameters."""


def _control_points_from_values(degree: int) -> ndarray:
    """The matrix that leads the values of a polynomial at `degree` + 1 even places on [0, 1], both ends
    included, to its Bezier control points."""
    x = np.arange(degree + 1) / degree
    return np.linalg.inv(
        np.array([[math.comb(degree, j) * a**j * (1 - a) ** (degree - j) for j in range(degree + 1)] for a in x])
    )


CUBIC_FROM_VALUES = _control_points_from_values(3)
SEXTIC_FROM_VALUES = _control_points_from_values(6)


@inner_njit(fastmath=CONTRACT)
def patch_point(p: ndarray, box: ndarray, s: float, t: float) -> Three:
    """The polynomial of a patch or net at (s, t), also outside its box."""
    a = bernstein((s - box[0]) / (box[1] - box[0]))
    b = bernstein((t - box[2]) / (box[3] - box[2]))
    x = y = z = 0.0
    for j in range(4):
        for i in range(4):
            w = a[i] * b[j]
            x += w * p[4 * j + i, 0]
            y += w * p[4 * j + i, 1]
            z += w * p[4 * j + i, 2]
    return x, y, z


@inner_njit(fastmath=CONTRACT)
def _largest_control_point(values: ndarray, T: ndarray) -> float:
    """The largest norm of the control points of the polynomial with these values (k, k, 3) at even places,
    which are overwritten by the control points; `T` (k, k) leads values to control points along one
    parameter."""
    k = len(T)
    half = np.zeros((k, k, 3))
    for j in range(k):
        for i in range(k):
            for m in range(k):
                for x in range(3):
                    half[j, i, x] += T[i, m] * values[j, m, x]
    worst = 0.0
    for j in range(k):
        for i in range(k):
            p = q = r = 0.0
            for m in range(k):
                p += T[j, m] * half[m, i, 0]
                q += T[j, m] * half[m, i, 1]
                r += T[j, m] * half[m, i, 2]
            values[j, i, 0], values[j, i, 1], values[j, i, 2] = p, q, r
            worst = max(worst, p * p + q * q + r * r)
    return math.sqrt(worst)


@inner_njit(fastmath=CONTRACT)
def _element_difference(
    on: DepthTarget, m: int, m_turn: float, n: int, n_turn: float, a: float, b: float, c: float, d: float
) -> float:
    """How far the polynomials of elements m and n, each moved on by whole turns in s, are apart on
    [a, b] x [c, d] at most."""
    values = np.empty((4, 4, 3))
    for j in range(4):
        t = c + (d - c) * j / 3.0
        for i in range(4):
            s = a + (b - a) * i / 3.0
            x, y = (
                patch_point(on.patches[m], on.boxes[m], s - m_turn, t),
                patch_point(on.patches[n], on.boxes[n], s - n_turn, t),
            )
            values[j, i, 0], values[j, i, 1], values[j, i, 2] = x[0] - y[0], x[1] - y[1], x[2] - y[2]
    return _largest_control_point(values, CUBIC_FROM_VALUES)


@inner_njit()
def _extension_error(on: DepthTarget, m: int, turn: int, a: float, b: float, c: float, d: float) -> float:
    """How far the polynomial of element m, moved on by `turn` turns in s, is from the surface on
    [a, b] x [c, d] at most."""
    lines, _, starts, lows, highs, ids, _ = on.strips
    worst = 0.0
    boxes = on.boxes
    if a >= boxes[m, 0] + turn and b <= boxes[m, 1] + turn and c >= boxes[m, 2] and d <= boxes[m, 3]:
        return worst
    if b - a < NARROWEST_MAP:
        a, b = a - NARROWEST_MAP, b + NARROWEST_MAP
    if d - c < NARROWEST_MAP:
        c, d = c - NARROWEST_MAP, d + NARROWEST_MAP
    for k in range(len(lines) - 1):
        if lines[k] >= d or lines[k + 1] <= c:
            continue
        for other in range(math.floor(a), math.floor(b) + 1):
            for i in range(starts[k], starts[k + 1]):
                low = max(a, lows[i] + other)
                high = min(b, highs[i] + other)
                n = ids[i]
                if low < high and not (n == m and other == turn):
                    worst = max(
                        worst,
                        _element_difference(on, m, turn, n, other, low, high, max(c, boxes[n, 2]), min(d, boxes[n, 3])),
                    )
    return worst


@njit(inline="always")
def middle_parameters(corners: ndarray) -> tuple[float, float]:
    """The mean of four parameters (4, 2)."""
    return 0.25 * (corners[0, 0] + corners[1, 0] + corners[2, 0] + corners[3, 0]), 0.25 * (
        corners[0, 1] + corners[1, 1] + corners[2, 1] + corners[3, 1]
    )


@njit(cache=True, fastmath=CONTRACT)
def mapped_distance_bound(net: ndarray, corners: ndarray, on: DepthTarget) -> tuple[float, float, int]:
    """How far (mm) the points of a net's patch are at most from their images on the surface under the
    bilinear map that takes its corners to the parameters `corners` (4, 2); how far the farthest corner is
    from its image; and the axis along which the difference bends more, -1 where the extension of an element
    bounds it."""
    a = b = corners[0, 0]
    c = d = corners[0, 1]
    for k in range(1, 4):
        a, b, c, d = (min(a, corners[k, 0]), max(b, corners[k, 0]), min(c, corners[k, 1]), max(d, corners[k, 1]))
    s, t = middle_parameters(corners)
    turn = math.floor(s)
    m = locate_one(*on.strips, s - turn, t)
    if not b - a <= WIDEST_MAP or m < 0:
        return np.inf, np.inf, -1
    values = np.empty((SAMPLES, SAMPLES, 3))
    for j in range(SAMPLES):
        v = j / (SAMPLES - 1.0)
        s0, s1 = (
            corners[0, 0] + v * (corners[2, 0] - corners[0, 0]),
            corners[1, 0] + v * (corners[3, 0] - corners[1, 0]),
        )
        t0, t1 = (
            corners[0, 1] + v * (corners[2, 1] - corners[0, 1]),
            corners[1, 1] + v * (corners[3, 1] - corners[1, 1]),
        )
        for i in range(SAMPLES):
            u = i / (SAMPLES - 1.0)
            x = patch_point(on.patches[m], on.boxes[m], s0 + u * (s1 - s0) - turn, t0 + u * (t1 - t0))
            y = patch_point(net, UNIT_BOX, u, v)
            values[j, i, 0], values[j, i, 1], values[j, i, 2] = y[0] - x[0], y[1] - x[1], y[2] - x[2]
    worst = _largest_control_point(values, SEXTIC_FROM_VALUES)
    corner = bend_s = bend_t = 0.0
    for j in range(SAMPLES):
        for i in range(SAMPLES):
            s = t = p = 0.0
            for x in range(3):
                p += values[j, i, x] ** 2
                if 0 < i < SAMPLES - 1:
                    s += (values[j, i - 1, x] - 2.0 * values[j, i, x] + values[j, i + 1, x]) ** 2
                    t += (values[i - 1, j, x] - 2.0 * values[i, j, x] + values[i + 1, j, x]) ** 2
            bend_s, bend_t = max(bend_s, s), max(bend_t, t)
            if (i == 0 or i == SAMPLES - 1) and (j == 0 or j == SAMPLES - 1):
                corner = max(corner, p)
    more = _extension_error(on, m, turn, a, b, c, d)
    if not worst + more < np.inf:
        return np.inf, np.inf, -1
    axis = 0 if bend_s >= bend_t else 1
    return worst + more, math.sqrt(corner), -1 if more * more > max(bend_s, bend_t) else axis


POINT_LIKE = 0.1
"""mm: pieces no larger than this may be bounded by the distance from one point."""

SLENDER = 8.0
"""A piece that is so many times longer than wide is halved along its length."""

MOST_LISTED = 1000
"""Most pieces over the alarm that are returned."""

RELATIVE_ACCURACY = 0.02
"""A bound is good enough up to this share of what the distance is over the alarm."""

CORNERS = np.array([0, 3, 12, 15])
"""Control points of a net at its corners, s first."""


@inner_njit()
def _bound_from_middle(
    net: ndarray, corners: ndarray, bound: float, on: DepthTarget, D: ndarray
) -> tuple[float, float]:
    """A bound (mm) no larger than `bound`, and the distance of the net's middle from the surface. From the
    nearest footpoint of the middle are taken: the largest distance of a control point from it, and the map
    whose corners are footpoints reached from it; a map that bounds better replaces `corners` (4, 2)."""
    middle = np.empty(3)
    other = np.empty((4, 2))
    middle[0], middle[1], middle[2] = patch_point(net, UNIT_BOX, 0.5, 0.5)
    s, t = middle_parameters(corners)
    s, t, distance = nearest_footpoint(middle, s, t, on, D)
    for k in range(4):
        u, v, _ = footpoint(net[CORNERS[k]], s, t, on, D)
        other[k, 0], other[k, 1] = u, v
    new, _, _ = mapped_distance_bound(net, other, on)
    if new < bound:
        bound = new
        copy(other, corners)
    e = locate_one(*on.strips, s - math.floor(s), t)
    far = 0.0
    x = patch_point(on.patches[e], on.boxes[e], s - math.floor(s), t)
    for i in range(16):
        far = max(far, (net[i, 0] - x[0]) ** 2 + (net[i, 1] - x[1]) ** 2 + (net[i, 2] - x[2]) ** 2)
    return min(bound, math.sqrt(far)), distance


@inner_njit()
def _divide(nets: ndarray, corners: ndarray, parts: ndarray, k: int, axis: int, on: DepthTarget, D: ndarray) -> None:
    """Replace piece k by its two halves, k and k + 1: their nets, the parameters of their corners'
    footpoints, and the part of the first net that they are."""
    halve(nets[k], axis, nets[k], nets[k + 1])
    copy(corners[k], corners[k + 1])
    for i in range(4):
        parts[k + 1, i] = parts[k, i]
    middle = 0.5 * (parts[k, 2 * axis] + parts[k, 2 * axis + 1])
    parts[k, 2 * axis + 1] = parts[k + 1, 2 * axis] = middle
    step, across = (1, 2) if axis == 0 else (2, 1)
    for side in range(2):
        first, last = side * across, side * across + step
        s, t = (0.5 * (corners[k, first, 0] + corners[k, last, 0]), 0.5 * (corners[k, first, 1] + corners[k, last, 1]))
        s, t, _ = footpoint(nets[k + 1, CORNERS[first]], s, t, on, D)
        corners[k, last, 0] = corners[k + 1, first, 0] = s
        corners[k, last, 1] = corners[k + 1, first, 1] = t


@njit(cache=True, nogil=True)
def depth_bound(
    nets: ndarray, starts: ndarray, on: DepthTarget, goal: float, alarm: float, accuracy: float, smallest: float
) -> tuple[float, ndarray, ndarray, int]:  # fmt: skip
    """How far (mm) points of the patches with these nets (n, 16, 3) are at most from a surface; the piece
    where that is; pieces (k, 3) with a bound over `alarm` mm; and how many pieces were bounded. A piece is
    told by the number of its net and the parameters of its middle there.

    `starts` (n, 4, 2) are parameters of the surface near the footpoints of the nets' corners. A piece is not
    halved again where its bound is no larger than `goal` mm or than that of another, or at most `accuracy` mm
    (and RELATIVE_ACCURACY) over a distance that some point has, or where it is no larger than `smallest` mm.
    """
    stack = np.empty((STACK_SIZE, 16, 3))
    corners = np.empty((STACK_SIZE, 4, 2))
    parts = np.empty((STACK_SIZE, 4))
    D = np.empty((6, 3))
    place = np.zeros(3)
    over = np.empty((MOST_LISTED, 3))
    most, count, listed = 0.0, 0, 0
    for n in range(len(nets)):
        copy(nets[n], stack[0])
        height = 1
        for k in range(4):
            parts[0, k] = UNIT_BOX[k]
            s, t, _ = footpoint(stack[0, CORNERS[k]], starts[n, k, 0], starts[n, k, 1], on, D)
            corners[0, k, 0], corners[0, k, 1] = s, t
        while height:
            height -= 1
            count += 1
            net = stack[height]
            enough = max(goal, most)
            last = height + 2 > STACK_SIZE
            bound, corner_distance, axis = mapped_distance_bound(net, corners[height], on)
            if bound > enough:
                s, t = extents(net)
                if axis < 0 or max(s, t) > SLENDER * (s if axis == 0 else t):
                    axis = 0 if s >= t else 1
                if corner_distance > enough or max(s, t) < POINT_LIKE or bound <= corner_distance + accuracy or last:
                    bound, distance = _bound_from_middle(net, corners[height], bound, on, D)
                    last = (
                        last
                        or bound <= distance + accuracy + RELATIVE_ACCURACY * max(0.0, distance - alarm)
                        or max(s, t) <= smallest
                    )
            if bound > enough and not last:
                _divide(stack, corners, parts, height, axis, on, D)
                height += 2
                continue
            u, v = 0.5 * (parts[height, 0] + parts[height, 1]), 0.5 * (parts[height, 2] + parts[height, 3])
            if bound > most:
                most = bound
                place[0], place[1], place[2] = n, u, v
            if bound > alarm and listed < MOST_LISTED:
                over[listed, 0], over[listed, 1], over[listed, 2] = n, u, v
                listed += 1
    return most, place, over[:listed], count
