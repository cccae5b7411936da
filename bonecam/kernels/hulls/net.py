"""Nets of control points, compiled: their halves, sizes and bounding boxes.

A net is the 16 control points (16, 3) of a bicubic Bezier patch, s fastest. The patch lies in the convex hull
of its net; the nets of its halves (de Casteljau's algorithm at 1/2) are closer to it.
"""

import math

from numpy import ndarray

from bonecam.kernels import inner_njit, njit

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
    return math.sqrt((net[b, 0] - net[a, 0]) ** 2 + (net[b, 1] - net[a, 1]) ** 2 + (net[b, 2] - net[a, 2]) ** 2)


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


@njit(inline="always")
def box_distance(box: ndarray, point: ndarray) -> float:
    """Distance of a point from a box."""
    square = 0.0
    for x in range(3):
        square += max(0.0, max(box[x] - point[x], point[x] - box[3 + x])) ** 2
    return math.sqrt(square)
