"""A distance that two sets of bicubic patches have at least, compiled: what separates the hulls of two nets
separates their patches.

Nets (`kernels.hulls.net`) are halved until their bounds are good enough.
"""

import math

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.hulls.net import STACK_SIZE, box_of, copy, extents, halve

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
def _diagonals_normal(net: ndarray) -> tuple[float, float, float]:
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
