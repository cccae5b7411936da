"""Maps of proven directions, compiled: the triangles of a subdivided icosahedron whose cones are proven free.

Each is proven by itself or in a larger one that holds it. One that is not proven is divided into four, whose proofs
begin where its own ended.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy import ndarray

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
    table, angles up to `tilt` from `normals` (k, 3). Axes that miss a limit by `band` at most are mapped too."""

    least: float
    largest: float
    above: ndarray
    tilt: float
    normals: ndarray
    band: float


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
