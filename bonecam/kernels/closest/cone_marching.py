"""Tools proven free for all axes of a cone at once, compiled: spheres about points of the cone's axis, one behind
the other.

A sphere of radius D about the point of the axis at height u is empty. For every axis within the angle rho of the cone's
it holds the tool's disc of radius r at each height between

    u cos(rho) -+ sqrt(D^2 - (r + u sin(rho))^2);

with rho = 0 these are the spheres of one tool. Where the apex may lie anywhere within `growth` of its place, D is
less by that. The cones are those about the triangles of a subdivided icosahedron: the map of an apex tells which of
the smallest ones are proven, each by itself or in a larger one that holds it.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.closest.distance_grids import Grids, distance_bound

LOOK_AHEAD = (4.0, 1.5, 0.5, 0.0)
"""How far above the proven height spheres are tried, in radii of the section."""
MIN_RISE = 0.01
"""A sphere that raises the proven height by less (mm) proves nothing."""
REJECTED, OPEN, PROVEN = 0, 1, 2
"""Of a cone: every axis in it meets something (as the grids have it), nothing is known, no axis meets anything."""


class Obstacles(NamedTuple):
    """What a tool stays out of. `sections` (s, 7) of the tool from the spindle down: start and end (mm above the ball's
    centre), radius (mm), 1 for the level or 0 for the material, what the solid may reach out of its grids by (mm),
    and the first and behind the last of its `columns` (m, 3): radius, top and bottom (mm)."""

    sections: ndarray
    columns: ndarray
    level: Grids
    material: Grids


class Apexes(NamedTuple):
    """Where tools pivot: `places` (k, 3) of ball centres, how far from there they may be (`growth`, mm), and what is
    known of the balls near their contacts: at each of them a ball that is larger by `room` (mm) touches the contact too
    and is empty; contact normals are within `spread` (radians) of `normals`."""

    places: ndarray
    growth: ndarray
    normals: ndarray
    spread: ndarray
    room: ndarray


class SphereTriangles(NamedTuple):
    """The triangles of a subdivided icosahedron on the unit sphere: unit `centres` (t, 3) and `caps` (t,), the angles
    (radians) of the cones about these that hold them, of all levels, coarsest first; level i from `starts[i]` up to
    `starts[i + 1]`. Triangle j of a level is divided into 4 j .. 4 j + 3 of the next. The last level are leaves."""

    centres: ndarray
    caps: ndarray
    starts: ndarray


class AxisLimits(NamedTuple):
    """What the axes of k nodes keep to, radians: polar angles from `least` to `largest` and to `above` (k,) for the
    table, angles up to `tilt` from `normals` (k, 3). Axes that miss a limit by `band` at most are mapped too."""

    least: float
    largest: float
    above: ndarray
    tilt: float
    normals: ndarray
    band: float


@njit(cache=True, nogil=True)
def _distance(o: Obstacles, s: int, x: float, y: float, z: float) -> float:
    """A lower bound of the distance of a point to what section s stays out of, mm."""
    if o.sections[s, 3] > 0:
        d = distance_bound(o.level, x, y, z)
    else:
        d = distance_bound(o.material, x, y, z)
    d -= o.sections[s, 4]
    across = np.sqrt(x * x + y * y)
    for c in range(int(o.sections[s, 5]), int(o.sections[s, 6])):
        out = across - o.columns[c, 0]
        up = max(z - o.columns[c, 1], o.columns[c, 2] - z)
        if out > 0 and up > 0:
            d = min(d, np.sqrt(out * out + up * up))
        else:
            d = min(d, max(out, up))
    return d


@njit(cache=True, nogil=True)
def _prove(
    o: Obstacles, p: Apexes, k: int, a: ndarray, angle: float, first: int, proven: float
) -> tuple[int, int, float]:
    """PROVEN where the tool at apex k is free for all axes within `angle` of the unit vector a, REJECTED or OPEN; and
    how far it is proven: the section, and the height in it. What lies before section `first` and the height `proven`
    in that one is known to be free."""
    sine, cosine = np.sin(angle), np.cos(angle)
    x, y, z = p.places[k, 0], p.places[k, 1], p.places[k, 2]
    for s in range(first, len(o.sections)):
        up, end, r = o.sections[s, 0], o.sections[s, 1], o.sections[s, 2]
        begins = up
        if o.sections[s, 3] > 0:
            n = p.normals[k]
            dot = min(max(a[0] * n[0] + a[1] * n[1] + a[2] * n[2], -1.0), 1.0)
            lean = np.arccos(dot) + p.spread[k] + angle
            # balls along an axis that leans by this from the normal stay in the larger ball as long
            up = max(up, 2 * p.room[k] * np.cos(min(lean, np.pi / 2)))
            begins = max(begins, 2 * p.room[k])
        if s == first:
            up = max(up, proven)
        last = 0
        while up < end:
            raised = up
            met = False
            for i in range(len(LOOK_AHEAD)):
                ahead = (max(last - 1, 0) + i) % len(LOOK_AHEAD)
                u = up + LOOK_AHEAD[ahead] * r
                d = _distance(o, s, x + u * a[0], y + u * a[1], z + u * a[2]) - p.growth[k]
                side = r + u * sine
                if d > side:
                    half = np.sqrt(d * d - side * side)
                    if u * cosine - half <= up and u * cosine + half > up + MIN_RISE:
                        raised = u * cosine + half
                        last = ahead
                        break
                elif begins <= u <= end and d + 2 * u * np.sin(angle / 2) < r:
                    met = True
            if raised == up:
                return (REJECTED if met else OPEN), s, up
            up = raised
    return PROVEN, len(o.sections), 0.0


@njit(cache=True, nogil=True)
def _prove_triangle(
    o: Obstacles,
    p: Apexes,
    first: int,
    triangles: SphereTriangles,
    t: int,
    level: int,
    sections: ndarray,
    heights: ndarray,
) -> int:
    """What `_prove` tells of a triangle and the apexes from `first` on together. Row `level` of `sections` and
    `heights` (levels + 1, apexes) are how far the larger triangle that holds it is proven; the next row becomes that of
    this one."""
    verdict = PROVEN
    for i in range(sections.shape[1]):
        one, sections[level + 1, i], heights[level + 1, i] = _prove(
            o, p, first + i, triangles.centres[t], triangles.caps[t], sections[level, i], heights[level, i]
        )
        verdict = min(verdict, one)
        if verdict == REJECTED:
            break
    return verdict


@njit(cache=True, nogil=True)
def direction_maps(
    o: Obstacles, p: Apexes, starts: ndarray, limits: AxisLimits, triangles: SphereTriangles
) -> tuple[ndarray, ndarray]:
    """For each node (k), which has the apexes from `starts[k]` up to `starts[k + 1]`, and each leaf: whether it is
    proven free for all of these apexes, and whether its centre keeps the limits."""
    last = len(triangles.starts) - 2
    leaves = triangles.starts[last + 1] - triangles.starts[last]
    centres = triangles.centres[triangles.starts[last] :]
    polar = np.arccos(np.minimum(np.maximum(centres[:, 2], -1.0), 1.0))
    nodes = len(starts) - 1
    proven, allowed = np.zeros((2, nodes, leaves), dtype=np.bool_)
    asked = np.empty(leaves, dtype=np.bool_)
    stack = np.empty((4 * len(triangles.starts) + 4, 2), dtype=np.int64)
    for k in range(nodes):
        sections = np.zeros((last + 2, starts[k + 1] - starts[k]), dtype=np.int64)
        heights = np.zeros(sections.shape)
        n = limits.normals[k]
        most = min(limits.largest, limits.above[k])
        near, nearly = np.cos(limits.tilt), np.cos(min(limits.tilt + limits.band, np.pi))
        for i in range(leaves):
            dot = centres[i, 0] * n[0] + centres[i, 1] * n[1] + centres[i, 2] * n[2]
            allowed[k, i] = dot >= near and limits.least <= polar[i] <= most
            asked[i] = dot >= nearly and limits.least - limits.band <= polar[i] <= most + limits.band
        for root in range(triangles.starts[1]):
            stack[0] = 0, root
            height = 1
            while height:
                height -= 1
                level, i = stack[height]
                size = 4 ** (last - level)
                if not asked[i * size : (i + 1) * size].any():
                    continue
                t = triangles.starts[level] + i
                verdict = _prove_triangle(o, p, starts[k], triangles, t, level, sections, heights)
                if verdict == PROVEN:
                    proven[k, i * size : (i + 1) * size] = True
                elif verdict == OPEN and level < last:
                    for child in range(4):
                        stack[height] = level + 1, 4 * i + child
                        height += 1
    return proven, allowed


@njit(cache=True, nogil=True)
def _holds_still(
    o: Obstacles,
    p: Apexes,
    first: int,
    end: int,
    matrix: ndarray,
    widened: ndarray,
    triangles: SphereTriangles,
) -> bool:
    """Whether all leaves that meet a cone are proven; `matrix` (3, 3) leads to its q, and `widened` (l, 2) are the
    factors of q1 and q2 with which it holds the centres of all triangles of a level that meet it."""
    last = len(triangles.starts) - 2
    stack = np.empty((4 * len(triangles.starts) + 4, 2), dtype=np.int64)
    sections = np.zeros((last + 2, end - first), dtype=np.int64)
    heights = np.zeros(sections.shape)
    for root in range(triangles.starts[1]):
        stack[0] = 0, root
        height = 1
        while height:
            height -= 1
            level, i = stack[height]
            t = triangles.starts[level] + i
            q = matrix @ triangles.centres[t]
            if q[2] <= 0 or (q[0] * widened[level, 0]) ** 2 + (q[1] * widened[level, 1]) ** 2 > q[2] ** 2:
                continue
            if _prove_triangle(o, p, first, triangles, t, level, sections, heights) == PROVEN:
                continue
            if level == last:
                return False
            for child in range(4):
                stack[height] = level + 1, 4 * i + child
                height += 1
    return True


@njit(cache=True, nogil=True)
def proof_slacks(
    o: Obstacles,
    p: Apexes,
    starts: ndarray,
    matrices: ndarray,
    angles: ndarray,
    tried: ndarray,
    triangles: SphereTriangles,
) -> ndarray:
    """The largest of the distances `tried` (mm, rising) by which the apexes of each node may be further off their
    places for its cone to be proven still; 0 for none. `matrices` (k, 3, 3) lead to the q of the cones, `angles` (k, 2)
    are their semi-angles, radians."""
    found = np.zeros(len(angles))
    moved = Apexes(p.places, p.growth.copy(), p.normals, p.spread, p.room)
    levels = len(triangles.starts) - 1
    widened = np.empty((levels, 2))
    for k in range(len(angles)):
        if not angles[k, 0] > 0:
            continue
        for level in range(levels):
            cap = triangles.caps[triangles.starts[level] : triangles.starts[level + 1]].max()
            for side in range(2):
                wide = min(angles[k, side] + cap, np.radians(85.0))
                widened[level, side] = np.tan(angles[k, side]) / np.tan(wide)
        first, end = starts[k], starts[k + 1]
        for more in tried:
            moved.growth[first:end] = p.growth[first:end] + more
            if not _holds_still(o, moved, first, end, matrices[k], widened, triangles):
                break
            found[k] = more
    return found
