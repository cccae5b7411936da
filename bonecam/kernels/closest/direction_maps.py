"""Maps of proven directions, compiled: the triangles of a subdivided icosahedron whose cones are proven free.

Each is proven by itself or in a larger one that holds it. One that is not proven is divided into four, whose proofs
begin where its own ended.

`prove` is compiled into what calls it here, and kept with this file: a change of it asks for one here too.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.closest.cone_marching import OPEN, PROVEN, REJECTED, Apexes, Obstacles, prove


class SphereTriangles(NamedTuple):
    """The triangles of a subdivided icosahedron on the unit sphere: unit `centres` (t, 3) and `caps` (t,), the angles
    (radians) of the cones about these that hold them, of all levels, coarsest first; level i from `starts[i]` up to
    `starts[i + 1]`. Triangle j of a level is divided into 4 j .. 4 j + 3 of the next. The last level are leaves."""

    centres: ndarray
    caps: ndarray
    starts: ndarray


class AxisLimits(NamedTuple):
    """What the axes of k nodes keep to, radians: polar angles from `least` to `largest` and to `above` (k,) for the
    table, angles up to `tilt` from `normals` (k, 3)."""

    least: float
    largest: float
    above: ndarray
    tilt: float
    normals: ndarray


@njit(cache=True, nogil=True)
def within_limits(limits: AxisLimits, directions: ndarray, band: float) -> ndarray:
    """Which of the unit vectors (l, 3) the axes of each node (k) may have, or miss a limit of by `band` (radians) at
    most: (k, l)."""
    polar = np.arccos(np.minimum(np.maximum(directions[:, 2], -1.0), 1.0))
    allowed = np.empty((len(limits.normals), len(directions)), dtype=np.bool_)
    near = np.cos(min(limits.tilt + band, np.pi))
    for k in range(len(allowed)):
        n = limits.normals[k]
        most = min(limits.largest, limits.above[k]) + band
        for i in range(len(directions)):
            dot = directions[i, 0] * n[0] + directions[i, 1] * n[1] + directions[i, 2] * n[2]
            allowed[k, i] = dot >= near and limits.least - band <= polar[i] <= most
    return allowed


@inner_njit()
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
    """What `prove` tells of a triangle and the apexes from `first` on together. Row `level` of `sections` and
    `heights` (levels + 1, apexes) are how far the larger triangle that holds it is proven; the next row becomes that of
    this one."""
    verdict = PROVEN
    for i in range(sections.shape[1]):
        one, sections[level + 1, i], heights[level + 1, i] = prove(
            o, p, first + i, triangles.centres[t], triangles.caps[t], sections[level, i], heights[level, i]
        )
        verdict = min(verdict, one)
        if verdict == REJECTED:
            break
    return verdict


@njit(cache=True, nogil=True)
def direction_maps(o: Obstacles, p: Apexes, starts: ndarray, asked: ndarray, triangles: SphereTriangles) -> ndarray:
    """For each node (k), which has the apexes from `starts[k]` up to `starts[k + 1]`, the leaves (l) that are proven
    free for all of these apexes; those that are not `asked` (k, l) need not be told."""
    last = len(triangles.starts) - 2
    proven = np.zeros(asked.shape, dtype=np.bool_)
    stack = np.empty((4 * len(triangles.starts) + 4, 2), dtype=np.int64)
    for k in range(len(starts) - 1):
        sections = np.zeros((last + 2, starts[k + 1] - starts[k]), dtype=np.int64)
        heights = np.zeros(sections.shape)
        for root in range(triangles.starts[1]):
            stack[0, 0], stack[0, 1] = 0, root
            height = 1
            while height:
                height -= 1
                level, i = stack[height, 0], stack[height, 1]
                size = 4 ** (last - level)
                wanted = False
                for leaf in range(i * size, (i + 1) * size):
                    wanted = wanted or asked[k, leaf]
                if not wanted:
                    continue
                t = triangles.starts[level] + i
                verdict = _prove_triangle(o, p, starts[k], triangles, t, level, sections, heights)
                if verdict == PROVEN:
                    proven[k, i * size : (i + 1) * size] = True
                elif verdict == OPEN and level < last:
                    for child in range(4):
                        stack[height, 0], stack[height, 1] = level + 1, 4 * i + child
                        height += 1
    return proven
