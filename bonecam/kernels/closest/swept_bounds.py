"""Where what a section of the tool sweeps in an elliptic cone is, compiled: which points it holds, and which facets of
its mesh are near a solid. Sizes are those of `swept_cones`.
"""

import numpy as np
from numpy import ndarray

from bonecam.kernels import njit
from bonecam.kernels.closest.swept_cones import LEAST_GROWTH, RIM_STEPS, dot, edges_of, normals_of, opening_of

PLANES = 12
"""So many planes about a solid are tried on each facet."""


@njit(cache=True, nogil=True)
def _holds(size: ndarray, sides: int, point: ndarray) -> bool:
    """Whether a point lies within the bounds of a mesh."""
    x, y, z = point
    first, second = opening_of(size)
    growth = max(size[5], LEAST_GROWTH)
    away, bottom = np.sqrt(x * x + y * y + z * z), size[0] - growth
    if away > np.hypot(size[2], size[1]) + growth or away < bottom:
        return False
    normals = np.empty((RIM_STEPS * sides, 3))
    normals_of(first, second, RIM_STEPS * sides, normals)
    beyond = normals @ point
    if beyond[::RIM_STEPS].max() > size[2] + growth:
        return False
    if z > 0 and np.hypot(x / first, y / second) <= z:
        return True
    if bottom > 0:
        return away * away - max(beyond.max(), 0.0) ** 2 >= bottom * bottom
    between, around = np.empty_like(normals), np.empty_like(normals)
    edges_of(first, second, RIM_STEPS * sides, 0.0, between, around)
    return bool((around @ point).max() >= bottom)


@njit(cache=True, nogil=True)
def swept_hold(sizes: ndarray, sides: int, points: ndarray) -> ndarray:
    """Whether each point (n, 3) lies within the bounds that the mesh of its size (n, 6) with so many sides has."""
    held = np.empty(len(points), np.bool_)
    for k in range(len(points)):
        held[k] = _holds(sizes[k], sides, points[k])
    return held


@njit(cache=True, nogil=True)
def facets_below(
    vertices: ndarray, faces: ndarray, place: ndarray, turn: ndarray, directions: ndarray, supports: ndarray
) -> tuple[ndarray, ndarray]:
    """The vertices and faces of a mesh, turned (3, 3) to a place, that may touch a solid, which reaches to `supports`
    (d) along unit `directions` (d, 3): of the planes there, those that the place is highest above leave out what lies
    beyond them."""
    away = directions @ place - supports
    planes = np.argsort(-away)[:PLANES]
    beyond = np.empty((len(planes), len(vertices)), np.bool_)
    for p in range(len(planes)):
        seen = turn.T @ directions[planes[p]]
        for v in range(len(vertices)):
            beyond[p, v] = dot(seen, vertices[v]) + away[planes[p]] > 0
    number = np.full(len(vertices), -1)
    kept = np.empty_like(faces)
    count, used = 0, 0
    for face in faces:
        off = False
        for p in range(len(planes)):
            if beyond[p, face[0]] and beyond[p, face[1]] and beyond[p, face[2]]:
                off = True
                break
        if off:
            continue
        for i in range(3):
            if number[face[i]] < 0:
                number[face[i]] = used
                used += 1
            kept[count, i] = number[face[i]]
        count += 1
    corners = np.empty((used, 3))
    for v in range(len(vertices)):
        if number[v] >= 0:
            corners[number[v]] = vertices[v]
    return corners, kept[:count]
