"""Bounds that hold between the points: what is so of the Bezier control points is so of the whole patch,
which lies in their hull.

A net is the 16 control points (16, 3) of a bicubic patch, s fastest. Nets are halved (de Casteljau) until
their bounds are good enough.
"""

import math

import numpy as np
from numba import njit
from numpy import ndarray

DEEPEST = 128
FINITE = {"nnan", "nsz", "reassoc", "contract"}


@njit(cache=True)
def halve(net: ndarray, axis: int, low: ndarray, high: ndarray) -> None:
    """The two halves of a net along s (axis 0) or t (1); `low` may be the net itself."""
    step, other = (1, 4) if axis == 0 else (4, 1)
    for k in range(4):
        a = k * other
        b, c, d = a + step, a + 2 * step, a + 3 * step
        for x in range(3):
            pq, qr, rs = (
                0.5 * (net[a, x] + net[b, x]),
                0.5 * (net[b, x] + net[c, x]),
                0.5 * (net[c, x] + net[d, x]),
            )
            pqr, qrs = 0.5 * (pq + qr), 0.5 * (qr + rs)
            middle, first, last = 0.5 * (pqr + qrs), net[a, x], net[d, x]
            low[a, x], low[b, x], low[c, x], low[d, x] = first, pq, pqr, middle
            high[a, x], high[b, x], high[c, x], high[d, x] = middle, qrs, rs, last


@njit(cache=True)
def copy(source: ndarray, target: ndarray) -> None:
    """Rows of one array into another: slices would compile for seconds."""
    for i in range(source.shape[0]):
        for x in range(source.shape[1]):
            target[i, x] = source[i, x]


@njit(inline="always")
def _way(net: ndarray, a: int, b: int) -> float:
    return math.sqrt(
        (net[b, 0] - net[a, 0]) ** 2 + (net[b, 1] - net[a, 1]) ** 2 + (net[b, 2] - net[a, 2]) ** 2
    )


@njit(cache=True)
def extents(net: ndarray) -> tuple[float, float]:
    """How long a net is along s and along t."""
    s = t = 0.0
    for k in range(4):
        s = max(
            s, _way(net, 4 * k, 4 * k + 1) + _way(net, 4 * k + 1, 4 * k + 2) + _way(net, 4 * k + 2, 4 * k + 3)
        )
        t = max(t, _way(net, k, 4 + k) + _way(net, 4 + k, 8 + k) + _way(net, 8 + k, 12 + k))
    return s, t


@njit(cache=True)
def box_of(net: ndarray, box: ndarray) -> None:
    """Lowest x, y, z and highest x, y, z of a net."""
    for x in range(3):
        box[x] = box[3 + x] = net[0, x]
        for i in range(1, 16):
            box[x], box[3 + x] = min(box[x], net[i, x]), max(box[3 + x], net[i, x])


@njit(inline="always")
def _between_boxes(a: ndarray, b: ndarray) -> float:
    """How far two boxes are apart along the axis on which they are farthest."""
    gap = max(b[0] - a[3], a[0] - b[3])
    gap = max(gap, max(b[1] - a[4], a[1] - b[4]))
    return max(gap, max(b[2] - a[5], a[2] - b[5]))


@njit(inline="always")
def box_distance(box: ndarray, point: ndarray) -> float:
    """Distance of a point from a box."""
    square = 0.0
    for x in range(3):
        square += max(0.0, max(box[x] - point[x], point[x] - box[3 + x])) ** 2
    return math.sqrt(square)


@njit(inline="always")
def _slab(a: ndarray, b: ndarray, x: float, y: float, z: float) -> float:
    """How far two nets are apart along a direction, on whichever side of each other they are; negative where
    they overlap."""
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
def _normal(net: ndarray) -> tuple[float, float, float]:
    """Across both diagonals."""
    a, b, c = net[15, 0] - net[0, 0], net[15, 1] - net[0, 1], net[15, 2] - net[0, 2]
    d, e, f = net[12, 0] - net[3, 0], net[12, 1] - net[3, 1], net[12, 2] - net[3, 2]
    return b * f - c * e, c * d - a * f, a * e - b * d


@njit(cache=True, fastmath=FINITE)
def _between_nets(a: ndarray, b: ndarray, enough: float) -> float:
    """A distance that the hulls of two nets have at least; the search for a plane between them ends where it
    is enough."""
    x, y, z = _normal(a)
    gap = _slab(a, b, x, y, z)
    if gap >= enough:
        return gap
    u, v, w = _normal(b)
    gap = max(gap, _slab(a, b, u, v, w))
    if gap >= enough:
        return gap
    p, q = math.sqrt(x * x + y * y + z * z), math.sqrt(u * u + v * v + w * w)
    if p > 0.0 and q > 0.0:
        gap = max(gap, _slab(a, b, x / p + u / q, y / p + v / q, z / p + w / q))
        if gap >= enough:
            return gap
    x = y = z = 0.0
    for i in range(16):
        x, y, z = x + b[i, 0] - a[i, 0], y + b[i, 1] - a[i, 1], z + b[i, 2] - a[i, 2]
    return max(gap, _slab(a, b, x, y, z))


@njit(cache=True, nogil=True)
def separation(
    inner: ndarray, outer: ndarray, goal: float, enough: float, small: float, smallest: float, most: int
) -> tuple[float, ndarray, int]:  # fmt: skip
    """A distance between two sets of patches (n, 16, 3) that they have at least, up to `goal`; where they are
    nearest; pairs looked at.

    Pieces are halved until their hulls are `goal` apart, or `small` and more than `enough`, or `smallest`;
    where these still overlap, or `most` pairs have been looked at, the surfaces may meet: then the distance
    is negative.
    """
    a_boxes, b_boxes = np.empty((len(inner), 6)), np.empty((len(outer), 6))
    for i in range(len(inner)):
        box_of(inner[i], a_boxes[i])
    for j in range(len(outer)):
        box_of(outer[j], b_boxes[j])
    A, B, a_box, b_box = np.empty((DEEPEST, 16, 3)), np.empty((DEEPEST, 16, 3)), np.empty(6), np.empty(6)
    least, place, count = goal, np.zeros(3), 0
    for i in range(len(inner)):
        for j in range(len(outer)):
            if _between_boxes(a_boxes[i], b_boxes[j]) >= goal:
                continue
            copy(inner[i], A[0])
            copy(outer[j], B[0])
            height = 1
            while height:
                height -= 1
                a, b = A[height], B[height]
                box_of(a, a_box)
                box_of(b, b_box)
                gap = _between_boxes(a_box, b_box)
                if gap >= least:
                    continue
                count += 1
                gap = max(gap, _between_nets(a, b, least))
                if gap >= least:
                    continue
                a_s, a_t = extents(a)
                b_s, b_t = extents(b)
                size = max(max(a_s, a_t), max(b_s, b_t))
                if (
                    (gap > enough and size <= small)
                    or size <= smallest
                    or height + 2 > DEEPEST
                    or count >= most
                ):
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
