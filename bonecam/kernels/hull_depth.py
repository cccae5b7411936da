"""How far patches are at most from a surface: bounds that hold between the points, compiled (see
kernels.hulls).

A patch is compared with the surface along a bilinear map of its parameters, which takes its corners to their
feet: the difference is a polynomial of degree six in both, no larger than the largest of its control points.
Where the map leaves one element of the surface that element's polynomial goes on, and what it is off there,
again a hull's bound, is added. Every such bound is true whatever the feet; good feet make it tight.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.bezier.bicubic import bernstein
from bonecam.kernels.bezier.element_search import locate_one
from bonecam.kernels.closest.newton import descend
from bonecam.kernels.fastmath import CONTRACT
from bonecam.kernels.hulls import DEEPEST, box_distance, copy, extents, halve

SIX = 7  # control points along a side at degree six
TURN = 0.4  # of a turn in s: feet of corners that are farther apart lie round a pole
NEAR = 0.1  # mm: pieces that are as small may be bounded by the distance from one point
SLENDER = 8.0  # a piece that is so much longer than wide is halved along its length
LISTED = 1000  # most pieces over the alarm that are told
PART = 0.02  # of what a distance is over the alarm: so far over it a bound is good enough
CORNERS = np.array([0, 3, 12, 15])
LINE = 1e-9  # maps no wider than this lead to a line
UNIT = np.array([0.0, 1.0, 0.0, 1.0])


class Target(NamedTuple):
    """The surface that depths are measured to, as kernels.closest.newton takes it: patches (e, 16, 4) whose
    weights are all one, over `boxes` in `strips`, s closed with the period 1. `seeds` (e, k, 5) are s, t, x,
    y, z of points on each element, `hulls` (e, 6) boxes round the elements as `kernels.hulls.box_of` makes
    them."""

    patches: ndarray
    boxes: ndarray
    strips: tuple[ndarray, ...]
    domain: ndarray
    period: ndarray
    poles: ndarray
    limit: ndarray
    seeds: ndarray
    hulls: ndarray


def _from_values(degree: int) -> ndarray:
    """Control points from the values at even places, both ends included."""
    x = np.arange(degree + 1) / degree
    return np.linalg.inv(
        np.array(
            [[math.comb(degree, j) * a**j * (1 - a) ** (degree - j) for j in range(degree + 1)] for a in x]
        )
    )


FROM_FOUR, FROM_SEVEN = _from_values(3), _from_values(6)


@njit(cache=True, fastmath=CONTRACT)
def _value(p: ndarray, box: ndarray, s: float, t: float) -> tuple[float, float, float]:
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


@njit(cache=True, fastmath=CONTRACT)
def _largest(values: ndarray, T: ndarray) -> float:
    """The largest norm of the control points of the polynomial with these values (k, k, 3) at even places;
    they replace the values."""
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


@njit(cache=True, fastmath=CONTRACT)
def _bend(
    on: Target, m: int, m_turn: float, n: int, n_turn: float, a: float, b: float, c: float, d: float
) -> float:
    """How far the polynomials of elements m and n, so many turns on in s, are apart on [a, b] x [c, d] at
    most."""
    values = np.empty((4, 4, 3))
    for j in range(4):
        t = c + (d - c) * j / 3.0
        for i in range(4):
            s = a + (b - a) * i / 3.0
            x, y = (
                _value(on.patches[m], on.boxes[m], s - m_turn, t),
                _value(on.patches[n], on.boxes[n], s - n_turn, t),
            )
            values[j, i, 0], values[j, i, 1], values[j, i, 2] = x[0] - y[0], x[1] - y[1], x[2] - y[2]
    return _largest(values, FROM_FOUR)


@njit(cache=True)
def _overhang(on: Target, m: int, turn: int, a: float, b: float, c: float, d: float) -> float:
    """How far the polynomial of element m, `turn` turns on in s, is from the surface on [a, b] x [c, d] at
    most."""
    lines, _, starts, lows, highs, ids, _ = on.strips
    worst, boxes = 0.0, on.boxes
    if a >= boxes[m, 0] + turn and b <= boxes[m, 1] + turn and c >= boxes[m, 2] and d <= boxes[m, 3]:
        return worst
    if b - a < LINE:
        a, b = a - LINE, b + LINE
    if d - c < LINE:
        c, d = c - LINE, d + LINE
    for k in range(len(lines) - 1):
        if lines[k] >= d or lines[k + 1] <= c:
            continue
        for other in range(math.floor(a), math.floor(b) + 1):
            for i in range(starts[k], starts[k + 1]):
                low, high, n = max(a, lows[i] + other), min(b, highs[i] + other), ids[i]
                if low < high and not (n == m and other == turn):
                    worst = max(
                        worst,
                        _bend(on, m, turn, n, other, low, high, max(c, boxes[n, 2]), min(d, boxes[n, 3])),
                    )
    return worst


@njit(inline="always")
def _middle(feet: ndarray) -> tuple[float, float]:
    return 0.25 * (feet[0, 0] + feet[1, 0] + feet[2, 0] + feet[3, 0]), 0.25 * (
        feet[0, 1] + feet[1, 1] + feet[2, 1] + feet[3, 1]
    )


@njit(cache=True, fastmath=CONTRACT)
def apart(net: ndarray, feet: ndarray, on: Target) -> tuple[float, float, int]:
    """How far the points of a net's patch are at most from those of the surface where the bilinear map of the
    corners' `feet` (4, 2) leads; how far the farthest corner is; and the axis along which the difference
    bends more, -1 where the map goes far astray."""
    a = b = feet[0, 0]
    c = d = feet[0, 1]
    for k in range(1, 4):
        a, b, c, d = min(a, feet[k, 0]), max(b, feet[k, 0]), min(c, feet[k, 1]), max(d, feet[k, 1])
    s, t = _middle(feet)
    turn = math.floor(s)
    m = locate_one(*on.strips, s - turn, t)
    if not b - a <= TURN or m < 0:
        return np.inf, np.inf, -1
    values = np.empty((SIX, SIX, 3))
    for j in range(SIX):
        v = j / (SIX - 1.0)
        s0, s1 = feet[0, 0] + v * (feet[2, 0] - feet[0, 0]), feet[1, 0] + v * (feet[3, 0] - feet[1, 0])
        t0, t1 = feet[0, 1] + v * (feet[2, 1] - feet[0, 1]), feet[1, 1] + v * (feet[3, 1] - feet[1, 1])
        for i in range(SIX):
            u = i / (SIX - 1.0)
            x = _value(on.patches[m], on.boxes[m], s0 + u * (s1 - s0) - turn, t0 + u * (t1 - t0))
            y = _value(net, UNIT, u, v)
            values[j, i, 0], values[j, i, 1], values[j, i, 2] = y[0] - x[0], y[1] - x[1], y[2] - x[2]
    worst = _largest(values, FROM_SEVEN)
    corner = bend_s = bend_t = 0.0
    for j in range(SIX):
        for i in range(SIX):
            s = t = p = 0.0
            for x in range(3):
                p += values[j, i, x] ** 2
                if 0 < i < SIX - 1:
                    s += (values[j, i - 1, x] - 2.0 * values[j, i, x] + values[j, i + 1, x]) ** 2
                    t += (values[i - 1, j, x] - 2.0 * values[i, j, x] + values[i + 1, j, x]) ** 2
            bend_s, bend_t = max(bend_s, s), max(bend_t, t)
            if (i == 0 or i == SIX - 1) and (j == 0 or j == SIX - 1):
                corner = max(corner, p)
    more = _overhang(on, m, turn, a, b, c, d)
    if not worst + more < np.inf:
        return np.inf, np.inf, -1
    axis = 0 if bend_s >= bend_t else 1
    return worst + more, math.sqrt(corner), -1 if more * more > max(bend_s, bend_t) else axis


@njit(cache=True)
def foot(point: ndarray, s: float, t: float, on: Target, D: ndarray) -> tuple[float, float, float]:
    """Parameters of a foot of a point near (s, t), as many turns on, and its distance. A start at a pole
    stays: its s is a direction."""
    if (on.poles[0] and t <= on.domain[1, 0]) or (on.poles[1] and t >= on.domain[1, 1]):
        return s, t, np.inf
    a, b, half = descend(
        on.patches, on.boxes, on.strips, on.domain, on.period, on.poles, on.limit, point, s, t, D
    )
    return a + math.floor(s - a + 0.5), b, math.sqrt(2.0 * half)


@njit(cache=True)
def nearest_foot(point: ndarray, s: float, t: float, on: Target, D: ndarray) -> tuple[float, float, float]:
    """Parameters and distance (mm) of the nearest foot found from (s, t) and from the nearest seed of every
    element whose box is nearer than the best foot so far."""
    s, t, distance = foot(point, s, t, on, D)
    for e in range(len(on.seeds)):
        if box_distance(on.hulls[e], point) >= distance:
            continue
        best, k = np.inf, 0
        for i in range(on.seeds.shape[1]):
            x, y, z = on.seeds[e, i, 2] - point[0], on.seeds[e, i, 3] - point[1], on.seeds[e, i, 4] - point[2]
            if x * x + y * y + z * z < best:
                best, k = x * x + y * y + z * z, i
        u, v, other = foot(point, on.seeds[e, k, 0], on.seeds[e, k, 1], on, D)
        if other < distance:
            s, t, distance = u, v, other
    return s, t, distance


@njit(cache=True)
def _look_again(net: ndarray, feet: ndarray, bound: float, on: Target, D: ndarray) -> tuple[float, float]:
    """A bound that may be less, from the nearest foot of a net's middle: its distance from all the net, or
    feet of the corners near it, which replace `feet`. And how far the middle is."""
    middle, other = np.empty(3), np.empty((4, 2))
    middle[0], middle[1], middle[2] = _value(net, UNIT, 0.5, 0.5)
    s, t = _middle(feet)
    s, t, distance = nearest_foot(middle, s, t, on, D)
    for k in range(4):
        u, v, _ = foot(net[CORNERS[k]], s, t, on, D)
        other[k, 0], other[k, 1] = u, v
    new, _, _ = apart(net, other, on)
    if new < bound:
        bound = new
        copy(other, feet)
    e, far = locate_one(*on.strips, s - math.floor(s), t), 0.0
    x = _value(on.patches[e], on.boxes[e], s - math.floor(s), t)
    for i in range(16):
        far = max(far, (net[i, 0] - x[0]) ** 2 + (net[i, 1] - x[1]) ** 2 + (net[i, 2] - x[2]) ** 2)
    return min(bound, math.sqrt(far)), distance


@njit(cache=True)
def _divide(nets: ndarray, feet: ndarray, parts: ndarray, k: int, axis: int, on: Target, D: ndarray) -> None:
    """Piece k becomes its two halves, k and k + 1, with feet sought between those of its corners."""
    halve(nets[k], axis, nets[k], nets[k + 1])
    copy(feet[k], feet[k + 1])
    for i in range(4):
        parts[k + 1, i] = parts[k, i]
    middle = 0.5 * (parts[k, 2 * axis] + parts[k, 2 * axis + 1])
    parts[k, 2 * axis + 1] = parts[k + 1, 2 * axis] = middle
    step, across = (1, 2) if axis == 0 else (2, 1)
    for side in range(2):
        first, last = side * across, side * across + step
        s, t = 0.5 * (feet[k, first, 0] + feet[k, last, 0]), 0.5 * (feet[k, first, 1] + feet[k, last, 1])
        s, t, _ = foot(nets[k + 1, CORNERS[first]], s, t, on, D)
        feet[k, last, 0] = feet[k + 1, first, 0] = s
        feet[k, last, 1] = feet[k + 1, first, 1] = t


@njit(cache=True, nogil=True)
def depth_bound(
    nets: ndarray, starts: ndarray, on: Target, goal: float, alarm: float, accuracy: float, smallest: float
) -> tuple[float, ndarray, ndarray, int]:  # fmt: skip
    """How far points of nets (n, 16, 3) are at most from a surface; the piece where that is; pieces (k, 3)
    with a bound over `alarm`; and how many pieces it took. A piece is told by its net and the parameters of
    its middle there.

    `starts` (n, 4, 2) are parameters of the surface near the feet of the nets' corners. A bound is good
    enough up to `goal` mm, or `accuracy` (and PART) more than a distance that there is, or where a piece is
    `smallest`; and where another is worse.
    """
    stack, feet, parts = np.empty((DEEPEST, 16, 3)), np.empty((DEEPEST, 4, 2)), np.empty((DEEPEST, 4))
    D, place, over = np.empty((6, 3)), np.zeros(3), np.empty((LISTED, 3))
    most, count, listed = 0.0, 0, 0
    for n in range(len(nets)):
        copy(nets[n], stack[0])
        height = 1
        for k in range(4):
            parts[0, k] = UNIT[k]
            s, t, _ = foot(stack[0, CORNERS[k]], starts[n, k, 0], starts[n, k, 1], on, D)
            feet[0, k, 0], feet[0, k, 1] = s, t
        while height:
            height -= 1
            count += 1
            net, enough, last = stack[height], max(goal, most), height + 2 > DEEPEST
            bound, corner, axis = apart(net, feet[height], on)
            if bound > enough:
                s, t = extents(net)
                if axis < 0 or max(s, t) > SLENDER * (s if axis == 0 else t):
                    axis = 0 if s >= t else 1
                if corner > enough or max(s, t) < NEAR or bound <= corner + accuracy or last:
                    bound, distance = _look_again(net, feet[height], bound, on, D)
                    last = (
                        last
                        or bound <= distance + accuracy + PART * max(0.0, distance - alarm)
                        or max(s, t) <= smallest
                    )
            if bound > enough and not last:
                _divide(stack, feet, parts, height, axis, on, D)
                height += 2
                continue
            u, v = 0.5 * (parts[height, 0] + parts[height, 1]), 0.5 * (parts[height, 2] + parts[height, 3])
            if bound > most:
                most = bound
                place[0], place[1], place[2] = n, u, v
            if bound > alarm and listed < LISTED:
                over[listed, 0], over[listed, 1], over[listed, 2] = n, u, v
                listed += 1
    return most, place, over[:listed], count
