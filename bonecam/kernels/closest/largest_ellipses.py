"""The largest elliptic cones in maps of proven directions, compiled.

In the chart of a direction w, where a direction is its point in the plane tangent to the unit sphere at w (gnomonic
projection), great circles are straight and cones ellipses. An ellipse that holds w and no point of an edge between
proven leaves and others holds proven directions alone. Sought is, over its centre c, turn and ratio, the most of

    2 ln s + ln(1 - |q|^2) - 3/2 ln(1 + |c|^2),

s^2 being its area over pi, q the place of w in it (0 at its centre, 1 at its rim): it is large, not far off w, and w
lies deep in it. A pattern search finds it, in two parameters at a time: the best lies against several edges.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit

WIDEST = 1.7
"""No point of an ellipse is further off w than this, in the chart: the tangent of 59.5 degrees."""
LOWEST = 0.2
"""Edges that reach further off w than this cosine are beyond WIDEST."""
RAYS = 96
"""Directions about w in which the nearest edges are found: others lie behind these."""
FIRST_STEPS = (0.4, 0.4, 0.5, 0.35)
"""Of the search: of the centre along both semi-axes, as shares of these; turn (radians), logarithm of the ratio."""
HALVINGS = 4
"""Times that these are halved."""


class LeafMesh(NamedTuple):
    """The leaves of a subdivided icosahedron as a mesh: unit `vertices` (v, 3), `leaves` (l, 3), `edges` (e, 2) by
    vertices, and the leaves (e, 2) `beside` them."""

    vertices: ndarray
    leaves: ndarray
    edges: ndarray
    beside: ndarray


@njit(cache=True, nogil=True)
def _holds(mesh: LeafMesh, leaf: int, w: ndarray) -> bool:
    """Whether a direction lies in a leaf or on its edge."""
    for i in range(3):
        a, b = mesh.vertices[mesh.leaves[leaf, i]], mesh.vertices[mesh.leaves[leaf, (i + 1) % 3]]
        cross = (
            (a[1] * b[2] - a[2] * b[1]) * w[0] + (a[2] * b[0] - a[0] * b[2]) * w[1] + (a[0] * b[1] - a[1] * b[0]) * w[2]
        )
        if cross < 0:
            return False
    return True


@inner_njit()
def _place_in(mesh: LeafMesh, centres: ndarray, proven: ndarray, w: ndarray) -> int:
    """Whether (-2) w lies in a proven leaf, else the proven leaf whose centre is nearest; -1 where there is none."""
    near, nearest = -1.0, -1
    close = -1.0
    closest: Any = np.int64(-1)  # a literal compiles `_holds` twice
    for leaf in range(len(centres)):
        dot = centres[leaf, 0] * w[0] + centres[leaf, 1] * w[1] + centres[leaf, 2] * w[2]
        if proven[leaf] and dot > near:
            near, nearest = dot, leaf
        if dot > close:
            close, closest = dot, leaf
    if nearest == closest and _holds(mesh, closest, w):
        return -2
    return nearest


@inner_njit()
def _reach(edges: ndarray, count: int, x: float, y: float, turn: float, ratio: float) -> float:
    """The s of the largest ellipse of this centre, turn and ratio that no edge enters."""
    cosine, sine = np.cos(turn), np.sin(turn)
    along, across = np.exp(-ratio), np.exp(ratio)
    least = max((WIDEST - np.hypot(x, y)) / np.exp(abs(ratio)), 0.0) ** 2
    for e in range(count):
        ax, ay, bx, by = edges[e, 0] - x, edges[e, 1] - y, edges[e, 2] - x, edges[e, 3] - y
        ax, ay = (cosine * ax + sine * ay) * along, (cosine * ay - sine * ax) * across
        bx, by = (cosine * bx + sine * by) * along, (cosine * by - sine * bx) * across
        dx, dy = bx - ax, by - ay
        part = min(max(-(ax * dx + ay * dy) / max(dx * dx + dy * dy, 1e-30), 0.0), 1.0)
        ax, ay = ax + part * dx, ay + part * dy
        least = min(least, ax * ax + ay * ay)
    return np.sqrt(least)


@inner_njit()
def _worth(edges: ndarray, count: int, at: ndarray) -> float:
    """What is to be most, of an ellipse `at` its centre, turn and logarithm of the ratio."""
    s = _reach(edges, count, at[0], at[1], at[2], at[3])
    cosine, sine = np.cos(at[2]), np.sin(at[2])
    along = (cosine * at[0] + sine * at[1]) * np.exp(-at[3])
    across = (cosine * at[1] - sine * at[0]) * np.exp(at[3])
    inside = s * s - along * along - across * across
    if not inside > 1e-12:
        return -np.inf
    return np.log(inside) - 1.5 * np.log(1 + at[0] ** 2 + at[1] ** 2)


@inner_njit()
def _seen(edges: ndarray, count: int) -> int:
    """Move the edges that are nearest to the origin in one of RAYS to the front; how many they are."""
    nearest = np.full(RAYS, np.inf)
    which = np.full(RAYS, -1)
    width = 2 * np.pi / RAYS
    for e in range(count):
        ax, ay, bx, by = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        cross = ax * by - ay * bx
        if cross < 0:
            ax, ay, bx, by, cross = bx, by, ax, ay, -cross
        begin, end = np.arctan2(ay, ax), np.arctan2(by, bx)
        if end < begin:
            end += 2 * np.pi
        for ray in range(int(np.ceil(begin / width)), int(np.floor(end / width)) + 1):
            cosine, sine = np.cos(ray * width), np.sin(ray * width)
            off = cross / max(cosine * (by - ay) - sine * (bx - ax), 1e-12)
            if off < nearest[ray % RAYS]:
                nearest[ray % RAYS], which[ray % RAYS] = off, e
    seen = np.zeros(count, dtype=np.bool_)
    for e in which:
        if e >= 0:
            seen[e] = True
    kept = 0
    for e in range(count):  # in rising order: none is overwritten before it is moved
        if seen[e]:
            for k in range(4):
                edges[kept, k], edges[e, k] = edges[e, k], edges[kept, k]
            kept += 1
    return kept


@inner_njit()
def _moved(at: ndarray, s: float, move: ndarray, out: ndarray) -> None:
    """Write an ellipse, whose s this is, moved: its centre by shares of its semi-axes, its turn and its ratio."""
    cosine, sine = np.cos(at[2]), np.sin(at[2])
    along, across = s * np.exp(at[3]) * move[0], s * np.exp(-at[3]) * move[1]
    out[0] = at[0] + cosine * along - sine * across
    out[1] = at[1] + sine * along + cosine * across
    out[2], out[3] = at[2] + move[2], at[3] + move[3]


@inner_njit()
def _search(edges: ndarray, count: int, at: ndarray, free: int) -> float:
    """Improve an ellipse in its first `free` parameters, one or two at a time; what it is worth."""
    steps = np.array(FIRST_STEPS)
    move, moved = np.zeros((2, 4))
    best = _worth(edges, count, at)
    for _ in range(HALVINGS + 1):
        better = True
        while better:
            better = False
            s = _reach(edges, count, at[0], at[1], at[2], at[3])
            for k in range(4 * free * free):
                i, j = k // 4 // free, k // 4 % free
                if j < i or (j == i and k % 4 > 1):
                    continue
                move[:], move[i] = 0.0, steps[i] * (2 * (k % 2) - 1)
                if j > i:
                    move[j] = steps[j] * (2 * (k // 2 % 2) - 1)
                _moved(at, s, move, moved)
                worth = _worth(edges, count, moved)
                if worth > best + 1e-3:
                    at[:] = moved
                    best = worth
                    better = True
                    s = _reach(edges, count, at[0], at[1], at[2], at[3])
        steps /= 2
    return best


@inner_njit()
def _dot(a: ndarray, b: ndarray) -> float:
    return 0.0 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_njit()
def _cross(a: ndarray, b: ndarray, product: ndarray) -> None:
    product[0] = a[1] * b[2] - a[2] * b[1]
    product[1] = a[2] * b[0] - a[0] * b[2]
    product[2] = a[0] * b[1] - a[1] * b[0]


@inner_njit()
def _tangents(w: ndarray, t1: ndarray, t2: ndarray) -> None:
    """Write two unit vectors across the unit vector w, and each other."""
    side = np.zeros(3)
    axis = 0
    for d in range(1, 3):
        if abs(w[d]) < abs(w[axis]):
            axis = d
    side[axis] = 1.0
    _cross(w, side, t1)
    size = np.sqrt(_dot(t1, t1))
    for d in range(3):
        t1[d] /= size
    _cross(w, t1, t2)


@inner_njit()
def _rim(mesh: LeafMesh, proven: ndarray, w: ndarray, t1: ndarray, t2: ndarray, edges: ndarray) -> int:
    """Write the edges between proven leaves and others into `edges`, in the chart of w; how many they are."""
    count: Any = np.int64(0)  # a literal compiles what takes it twice
    for e in range(len(mesh.edges)):
        if proven[mesh.beside[e, 0]] == proven[mesh.beside[e, 1]]:
            continue
        a, b = mesh.vertices[mesh.edges[e, 0]], mesh.vertices[mesh.edges[e, 1]]
        za, zb = _dot(a, w), _dot(b, w)
        if za > LOWEST and zb > LOWEST:
            edges[count, 0], edges[count, 1] = _dot(a, t1) / za, _dot(a, t2) / za
            edges[count, 2], edges[count, 3] = _dot(b, t1) / zb, _dot(b, t2) / zb
            count += 1
    return count


@njit(cache=True, nogil=True)
def largest_ellipses(
    proven: ndarray, wanted: ndarray, mesh: LeafMesh, centres: ndarray, circular: bool
) -> tuple[ndarray, ndarray]:
    """For each map of proven leaves (k, l) the axes D and semi-diameters U and V (k, 3, 3) of a cone of proven
    directions about the unit vector `wanted` (k, 3), or about the nearest proven leaf; and whether there is one.
    `centres` (l, 3) are those of the leaves."""
    frames = np.zeros((len(wanted), 3, 3))
    has_cone = np.zeros(len(wanted), dtype=np.bool_)
    edges = np.empty((len(mesh.edges), 4))
    t1, t2 = np.empty((2, 3))
    for k in range(len(wanted)):
        leaf = _place_in(mesh, centres, proven[k], wanted[k])
        if leaf == -1:
            continue
        w = wanted[k] if leaf == -2 else centres[leaf]
        _tangents(w, t1, t2)
        count = _rim(mesh, proven[k], w, t1, t2, edges)
        seen = _seen(edges, count)
        best = np.zeros(4)
        _search(edges, seen, best, 2 if circular else 4)
        s = _reach(edges, count, best[0], best[1], best[2], best[3])
        if not _worth(edges, count, best) > -np.inf:
            continue
        cosine, sine = np.cos(best[2]), np.sin(best[2])
        for d in range(3):
            frames[k, 0, d] = w[d] + best[0] * t1[d] + best[1] * t2[d]
            frames[k, 1, d] = s * np.exp(best[3]) * (cosine * t1[d] + sine * t2[d])
            frames[k, 2, d] = s * np.exp(-best[3]) * (cosine * t2[d] - sine * t1[d])
        has_cone[k] = True
    return frames, has_cone
