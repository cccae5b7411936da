"""Where what a section of the tool sweeps in an elliptic cone is, compiled: which points it holds, what it is clear of,
and which facets of its mesh are near a solid. Sizes are those of `swept_cones`.
"""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.closest.swept_cones import (
    LEAST_GROWTH,
    RIM_SHARE,
    RIM_STEPS,
    dot,
    normals_of,
    opening_of,
    rim_of,
)

PLANES = 12
"""So many planes about a solid are tried on each facet."""


@njit(cache=True, nogil=True)
def _holds(size: ndarray, sides: int, point: ndarray) -> bool:
    """Whether a point lies within the bounds of a mesh."""
    x, y, z = point
    first, second = opening_of(size)
    growth = max(size[5], LEAST_GROWTH)
    away = np.sqrt(x * x + y * y + z * z)
    if away > np.hypot(size[2], size[1]) + growth or away < size[0] - growth - RIM_SHARE * away:
        return False
    normals = np.empty((sides, 3))
    normals_of(first, second, sides, normals)
    for k in range(sides):
        if dot(normals[k], point) > size[2] + growth:
            return False
    if z > 0 and np.hypot(x / first, y / second) <= z:
        return True
    rim = np.empty((RIM_STEPS * sides, 3))
    rim_of(first, second, sides, RIM_STEPS, 0.0, rim)
    return bool((rim @ point).max() + RIM_SHARE * away >= size[0] - growth)


@njit(cache=True, nogil=True)
def swept_hold(sizes: ndarray, sides: int, points: ndarray) -> ndarray:
    """Whether each point (n, 3) lies within the bounds that the mesh of its size (n, 6) with so many sides has."""
    held = np.empty(len(points), np.bool_)
    for k in range(len(points)):
        held[k] = _holds(sizes[k], sides, points[k])
    return held


@njit(cache=True, nogil=True)
def _below(least: float, axis: ndarray, angle: tuple[float, float], place: ndarray, points: ndarray) -> bool:
    """Whether no axis within an angle (its sine, its cosine) of one through a place brings a point to `least` above."""
    sine, cosine = angle
    for point in points:
        x, y, z = point[0] - place[0], point[1] - place[1], point[2] - place[2]
        up = x * axis[0] + y * axis[1] + z * axis[2]
        square = x * x + y * y + z * z
        out = np.sqrt(max(square - up * up, 0.0))
        height = np.sqrt(square) if up * sine >= out * cosine else up * cosine + out * sine
        if height >= least:
            return False
    return True


@njit(cache=True, nogil=True)
def _beside(wide: float, normals: ndarray, place: ndarray, points: ndarray) -> bool:
    """Whether all points lie beyond one of the planes that are `wide` from a place along their normals."""
    for normal in normals:
        least = wide + dot(normal, place)
        beyond = True
        for point in points:
            if dot(normal, point) <= least:
                beyond = False
                break
        if beyond:
            return True
    return False


@njit(cache=True, nogil=True)
def swept_apart(sizes: ndarray, sides: int, places: ndarray, turns: ndarray, hulls: ndarray) -> ndarray:
    """Whether what is swept about each place (n, 3), turned (n, 3, 3), is told from several convex hulls of corners
    (h, m, 3), each of them by its heights above the place or by a plane beside the sweep."""
    apart = np.ones(len(sizes), np.bool_)
    normals, turned = np.empty((sides, 3)), np.empty((sides, 3))
    for k in range(len(sizes)):
        first, second = opening_of(sizes[k])
        widest = np.arctan(max(first, second))
        angle = np.sin(widest), np.cos(widest)
        growth = max(sizes[k, 5], LEAST_GROWTH)
        normals_of(first, second, sides, normals)
        for j in range(sides):
            for i in range(3):
                turned[j, i] = dot(turns[k, i], normals[j])
        axis = turns[k, :, 2].copy()
        for hull in hulls:
            if not _below(sizes[k, 0] - growth, axis, angle, places[k], hull) and not _beside(
                sizes[k, 2] + growth, turned, places[k], hull
            ):
                apart[k] = False
                break
    return apart


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
