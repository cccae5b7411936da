"""What a section of the tool sweeps in an elliptic cone, told from the triangles of a solid by planes, compiled.

With n the outward normal of a plane tangent to the cone, a point x of a section of radius r that begins at h, grown by
g, has for its axis a, where h > g,

    out (n . x - r) + down (h - x . a) <= g,    out^2 + down^2 = 1,    out, down >= 0,

and for the highest x . a of an axis of the cone the left side is concave in x. So a triangle is clear where it is more
than g at all three corners, for one n, out and down; and where it is farther away than the section reaches. A tree of
boxes (`triangle_tree`) leaves out most triangles. Sizes are those of `swept_cones`.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.closest.swept_cones import LEAST_GROWTH, normals_of, opening_of
from bonecam.kernels.closest.triangle_tree import DEEPEST, squared_triangle_distance

TILTS = ((0.75**0.5, 0.5), (0.5**0.5, 0.5**0.5), (0.5, 0.75**0.5))
"""`out` and `down` between a plane beside the sweep (1, 0) and one below it (0, 1)."""


class Bounds(NamedTuple):
    """Bounds of what a section sweeps, the apex in the origin and the cone's axis along Z: planes beside it have these
    `normals` and are `wide` away; it reaches as far as `top`; along an axis of the cone, which is in a circular one of
    an angle with this `sine` and `cosine`, each of its points is at `least` above the apex; `growth` is in all of
    these; mm."""

    normals: ndarray
    wide: float
    top: float
    least: float
    growth: float
    sine: float
    cosine: float


@njit(cache=True, nogil=True)
def _bounds(size: ndarray, sides: int) -> Bounds:
    first, second = opening_of(size)
    growth = max(size[5], LEAST_GROWTH)
    normals = np.empty((sides, 3))
    normals_of(first, second, sides, normals)
    widest = np.arctan(max(first, second))
    top = np.hypot(size[2], size[1]) + growth
    return Bounds(normals, size[2] + growth, top, size[0] - growth, growth, np.sin(widest), np.cos(widest))


@inner_njit()
def _height(b: Bounds, x: float, y: float, z: float, beyond: float) -> float:
    """How high above the apex a point is at most, seen along axes of the cone; it is `beyond` the tangent planes (0
    inside all of them). Without what it has along the outward normal of one it is seen no lower."""
    out = np.sqrt(x * x + y * y)
    square = x * x + y * y + z * z
    across = np.sqrt(max(square - beyond * beyond, 0.0))
    return across if z * b.sine >= out * b.cosine else min(across, z * b.cosine + out * b.sine)


@inner_njit()
def _box_is_clear(b: Bounds, middle: ndarray, half: ndarray) -> bool:
    """Whether a box, turned into the frame of the sweep, is told: its middle, and its half edges (rows)."""
    x, y, z = middle
    radius = np.sqrt((half * half).sum())
    if np.sqrt(x * x + y * y + z * z) - radius > b.top:
        return True
    beyond = 0.0
    for j in range(len(b.normals)):
        n = b.normals[j]
        least = n[0] * x + n[1] * y + n[2] * z
        beyond = max(beyond, least)
        for i in range(3):
            least -= abs(n[0] * half[i, 0] + n[1] * half[i, 1] + n[2] * half[i, 2])
        if least > b.wide:
            return True
    return _height(b, x, y, z, beyond) + radius < b.least


@inner_njit()
def _edge_is_clear(b: Bounds, corners: ndarray, heights: ndarray) -> bool:
    """Whether a triangle, whose corners are no higher than these heights, is told from the lower edge of the section by
    a tilted plane."""
    for j in range(len(b.normals)):
        x, y, z = b.normals[j, 0], b.normals[j, 1], b.normals[j, 2]
        for out, down in TILTS:
            lowest = np.inf
            for i in range(3):
                beside = x * corners[3 * i] + y * corners[3 * i + 1] + z * corners[3 * i + 2] - b.wide + b.growth
                lowest = min(lowest, out * beside + down * (b.least + b.growth - heights[i]))
            if lowest > b.growth:
                return True
    return False


@inner_njit()
def _triangle_is_clear(b: Bounds, corners: ndarray, beyond: ndarray) -> bool:
    """Whether a triangle (9), turned into the frame of the sweep, is told; `beyond` (3) is room for that."""
    beyond[:] = 0.0
    for j in range(len(b.normals)):
        x, y, z = b.normals[j, 0], b.normals[j, 1], b.normals[j, 2]
        lowest = np.inf
        for i in range(3):
            up = x * corners[3 * i] + y * corners[3 * i + 1] + z * corners[3 * i + 2]
            beyond[i] = max(beyond[i], up)
            lowest = min(lowest, up)
        if lowest > b.wide:
            return True
    highest = -np.inf
    for i in range(3):
        beyond[i] = _height(b, corners[3 * i], corners[3 * i + 1], corners[3 * i + 2], beyond[i])
        highest = max(highest, beyond[i])
    if highest < b.least or squared_triangle_distance(0.0, 0.0, 0.0, corners) > b.top * b.top:
        return True
    return b.least > 0.0 and _edge_is_clear(b, corners, beyond)


@njit(cache=True, nogil=True)
def swept_clear(
    sizes: ndarray, sides: int, places: ndarray, turns: ndarray, triangles: ndarray, boxes: ndarray
) -> ndarray:
    """Which of the sweeps (n, 6), with their apexes at `places` and turned (n, 3, 3), are told from all triangles of a
    tree by planes of so many sides."""
    clear = np.ones(len(sizes), np.bool_)
    count = len(triangles)
    leaves = (len(boxes) + 1) // 2
    stack = np.empty(DEEPEST, np.int64)
    middle = np.empty(3)
    half = np.empty((3, 3))
    corners, beyond = np.empty(9), np.empty(3)
    for k in range(len(sizes)):
        bounds = _bounds(sizes[k], sides)
        turn = turns[k]
        place = places[k]
        stack[0], height = 0, 1
        while height and clear[k]:
            height -= 1
            node = stack[height]
            middle[:] = 0.0
            for d in range(3):
                low, high = boxes[node, d] - place[d], boxes[node, 3 + d] - place[d]
                for i in range(3):
                    middle[i] += turn[d, i] * (low + high) / 2
                    half[d, i] = turn[d, i] * (high - low) / 2
            if boxes[node, 0] > boxes[node, 3] or _box_is_clear(bounds, middle, half):
                continue
            if node < leaves - 1:
                stack[height], stack[height + 1] = 2 * node + 1, 2 * node + 2
                height += 2
                continue
            leaf = node - leaves + 1
            for t in range(leaf * count // leaves, (leaf + 1) * count // leaves):
                corners[:] = 0.0
                for d in range(9):
                    off = triangles[t, d] - place[d % 3]
                    for i in range(3):
                        corners[d - d % 3 + i] += turn[d % 3, i] * off
                if not _triangle_is_clear(bounds, corners, beyond):
                    clear[k] = False
                    break
    return clear
