"""Signed distances of points from a capsule and its normals there, compiled."""

import numpy as np
from numpy import ndarray

from bonecam.kernels import njit
from bonecam.kernels.fastmath import CONTRACT

ON_AXIS = 1e5 * np.finfo(np.float64).eps
"""Points nearer to the axis segment have a direction that is rounding alone: share of the capsule's size and
its distance from the origin."""


@njit(cache=True, fastmath=CONTRACT, nogil=True)
def distances_and_normals(
    points: ndarray, start: ndarray, axis: ndarray, radius: float, sideways: ndarray, distance: ndarray, out: ndarray
) -> None:
    """Write the signed distances (negative inside) into `distance` (n,) and the outward unit normals into
    `out` (n, 3).

    The axis segment goes from `start` to `start + axis`; points on it take the normal `sideways`.
    """
    square = axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]
    away = start[0] * start[0] + start[1] * start[1] + start[2] * start[2]
    least = ON_AXIS * (radius + np.sqrt(square) + np.sqrt(away))
    for l in range(len(points)):
        x, y, z = points[l, 0] - start[0], points[l, 1] - start[1], points[l, 2] - start[2]
        along = min(max((x * axis[0] + y * axis[1] + z * axis[2]) / square, 0.0), 1.0) if square > 0.0 else 0.0
        x, y, z = x - along * axis[0], y - along * axis[1], z - along * axis[2]
        reach = np.sqrt(x * x + y * y + z * z)
        distance[l] = reach - radius
        if reach > least:
            out[l, 0], out[l, 1], out[l, 2] = x / reach, y / reach, z / reach
        else:
            out[l, 0], out[l, 1], out[l, 2] = sideways[0], sideways[1], sideways[2]
