"""The distance of a cone of the tool from an upright cylinder about the Z axis, compiled.

Two points, one on either body, are projected onto the other body in turn, from the common perpendicular of the axes
on; the plane between them bounds the distance from below. Along faces that are almost parallel that creeps: there the
nearest point lies on a rim, so the rims are searched too.
"""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit

MOST_STEPS = 300
"""Projections at most; about ten are usual."""
TOLERANCE = 1e-3
"""Where the distance and its bound agree so well the search ends, mm."""
RIM_POINTS = 24
"""Points of a rim that are looked at first."""
RIM_STEPS = 16
"""Thirds of the arc between the two beside the best of them: to 0.1 um of a rim of 40 mm radius."""


@inner_njit()
def _onto_segment(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """The point of the segment from a to b that is nearest to (x, y)."""
    sx, sy = bx - ax, by - ay
    square = sx * sx + sy * sy
    share = 0.0
    if square > 0.0:
        share = min(max(((x - ax) * sx + (y - ay) * sy) / square, 0.0), 1.0)
    return ax + share * sx, ay + share * sy


@inner_njit()
def _onto_cone(p: ndarray, foot: ndarray, axis: ndarray, section: ndarray, nearest: ndarray) -> None:
    """Write the point of a cone that is nearest to `p` into `nearest`; `section` (4,): from, to along the unit `axis`
    from `foot`, radius at either."""
    start, end, first, last = section[0], section[1], section[2], section[3]
    along = 0.0
    for k in range(3):
        along += (p[k] - foot[k]) * axis[k]
    square = 0.0
    for k in range(3):
        nearest[k] = p[k] - foot[k] - along * axis[k]
        square += nearest[k] ** 2
    out = np.sqrt(square)
    height, radius = along, out
    length = end - start
    inside = start <= along <= end and out * length <= first * (end - along) + last * (along - start)
    if not inside:
        height, radius = _onto_segment(along, out, start, first, end, last)
        best = np.hypot(along - height, out - radius)
        for level, wide in ((start, first), (end, last)):
            near = min(out, wide)
            if np.hypot(along - level, out - near) < best:
                best = np.hypot(along - level, out - near)
                height = level
                radius = near
    share = radius / out if out > 0.0 else 0.0
    for k in range(3):
        nearest[k] = foot[k] + height * axis[k] + share * nearest[k]


@inner_njit()
def _onto_column(p: ndarray, column: ndarray, nearest: ndarray) -> None:
    """Write the point of an upright cylinder that is nearest to `p`; `column` (3,): radius, z of top and bottom."""
    out = np.hypot(p[0], p[1])
    share = min(column[0] / out, 1.0) if out > 0.0 else 1.0
    nearest[0], nearest[1] = share * p[0], share * p[1]
    nearest[2] = min(max(p[2], column[2]), column[1])


@inner_njit()
def _cone_support(n: ndarray, foot: ndarray, axis: ndarray, section: ndarray, farthest: ndarray) -> None:
    """Write the point of a cone that is farthest along -n into `farthest`."""
    along = n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2]
    size = np.sqrt(max(1.0 - along * along, 0.0))
    height, radius = section[0], section[2]
    if section[1] * along - section[3] * size < section[0] * along - section[2] * size:
        height, radius = section[1], section[3]
    share = radius / size if size > 0.0 else 0.0
    for k in range(3):
        farthest[k] = foot[k] + height * axis[k] - share * (n[k] - along * axis[k])


@inner_njit()
def _column_support(n: ndarray, column: ndarray, farthest: ndarray) -> None:
    """Write the point of an upright cylinder that is farthest along n into `farthest`."""
    flat = np.hypot(n[0], n[1])
    share = column[0] / flat if flat > 0.0 else 0.0
    farthest[0], farthest[1] = share * n[0], share * n[1]
    farthest[2] = column[1] if n[2] > 0.0 else column[2]


@inner_njit()
def _apart(a: ndarray, b: ndarray) -> float:
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@inner_njit()
def _rim_point(angle: float, middle: ndarray, e: ndarray, f: ndarray, radius: float, point: ndarray) -> None:
    for k in range(3):
        point[k] = middle[k] + radius * (np.cos(angle) * e[k] + np.sin(angle) * f[k])


@inner_njit()
def _cone_rims(foot: ndarray, axis: ndarray, section: ndarray, column: ndarray) -> float:
    """The least distance of the two rims of a cone from the cylinder."""
    e, f, middle, p, q = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    flat = np.hypot(axis[0], axis[1])
    e[0], e[1], e[2] = (-axis[1] / flat, axis[0] / flat, 0.0) if flat > 0.0 else (1.0, 0.0, 0.0)
    f[0] = axis[1] * e[2] - axis[2] * e[1]
    f[1] = axis[2] * e[0] - axis[0] * e[2]
    f[2] = axis[0] * e[1] - axis[1] * e[0]
    best = np.inf
    for side in range(2):
        for k in range(3):
            middle[k] = foot[k] + section[side] * axis[k]
        low, high = 0.0, 2 * np.pi
        for step in range(1 + RIM_STEPS):
            count = RIM_POINTS if step == 0 else 2
            nearest = np.inf
            at = 0.0
            for m in range(count):
                angle = low + (high - low) * (m + (step > 0)) / (count + (step > 0))
                _rim_point(angle, middle, e, f, section[2 + side], p)
                _onto_column(p, column, q)
                if _apart(p, q) < nearest:
                    nearest = _apart(p, q)
                    at = angle
            half = 2 * np.pi / RIM_POINTS if step == 0 else (high - low) / 3
            low, high = at - half, at + half
            best = min(best, nearest)
    return best


@inner_njit()
def _column_rims(foot: ndarray, axis: ndarray, section: ndarray, column: ndarray) -> float:
    """The least distance of the two rims of the cylinder from the cone."""
    p, q = np.empty(3), np.empty(3)
    best = np.inf
    for side in range(2):
        p[2] = column[1 + side]
        low, high = 0.0, 2 * np.pi
        for step in range(1 + RIM_STEPS):
            count = RIM_POINTS if step == 0 else 2
            nearest = np.inf
            at = 0.0
            for m in range(count):
                angle = low + (high - low) * (m + (step > 0)) / (count + (step > 0))
                p[0], p[1] = column[0] * np.cos(angle), column[0] * np.sin(angle)
                _onto_cone(p, foot, axis, section, q)
                if _apart(p, q) < nearest:
                    nearest = _apart(p, q)
                    at = angle
            half = 2 * np.pi / RIM_POINTS if step == 0 else (high - low) / 3
            low, high = at - half, at + half
            best = min(best, nearest)
    return best


@njit(cache=True, nogil=True)
def column_distance(foot: ndarray, axis: ndarray, section: ndarray, column: ndarray, within: float) -> float:
    """The distance of a cone of the tool from an upright cylinder, mm: 0 where they meet, `within` where it is more.

    `section` (4,): from, to along the unit `axis` from `foot`, radius at either; `column` (3,): radius, z of top
    and bottom.
    """
    x, y, n = np.empty(3), np.empty(3), np.empty(3)
    x_far, y_far = np.empty(3), np.empty(3)
    # where the axes are nearest to one another
    flat = axis[0] ** 2 + axis[1] ** 2
    along = -(foot[0] * axis[0] + foot[1] * axis[1]) / flat if flat > 0.0 else 0.0
    along = min(max(along, section[0]), section[1])
    for k in range(3):
        x[k] = foot[k] + along * axis[k]
    _onto_column(x, column, y)
    apart = np.inf
    for _ in range(MOST_STEPS):
        _onto_cone(y, foot, axis, section, x)
        _onto_column(x, column, y)
        apart = _apart(x, y)
        if apart <= TOLERANCE:
            return 0.0
        for k in range(3):
            n[k] = (x[k] - y[k]) / apart
        _cone_support(n, foot, axis, section, x_far)
        _column_support(n, column, y_far)
        bound = 0.0
        for k in range(3):
            bound += n[k] * (x_far[k] - y_far[k])
        if bound >= within:
            return within
        if apart - bound <= TOLERANCE:
            return apart
    apart = min(apart, _cone_rims(foot, axis, section, column), _column_rims(foot, axis, section, column))
    return min(apart, within)
