"""A bound of the distance between a net's patch and a surface, along a map of the patch's parameters,
compiled.

The map is bilinear and takes the corners of the patch to footpoints of theirs on the surface. The difference
of the patch and the image of the map is a polynomial of degree six in both parameters, no larger anywhere
than the largest of its control points. Where the map leaves one element of the surface, that element's
polynomial is extended, and a bound of what the extension is off there is added. The bound is true whatever
the map; good footpoints make it tight.
"""

import math

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.bezier.bicubic import bernstein
from bonecam.kernels.bezier.element_search import locate_one
from bonecam.kernels.fastmath import CONTRACT
from bonecam.kernels.hulls.footpoints import DepthTarget

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
def patch_point(p: ndarray, box: ndarray, s: float, t: float) -> tuple[float, float, float]:
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
