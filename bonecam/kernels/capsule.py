"""Distance of points from a capsule, and the way out of it, compiled."""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.fastmath import CONTRACT

ON_AXIS = 1e5 * np.finfo(np.float64).eps
"""Points so near to the axis segment, as a share of the capsule's size and its way from the origin, have no
direction but rounding's."""


@njit(cache=True, fastmath=CONTRACT, nogil=True)
def distances_and_normals(
    points: ndarray,
    start: ndarray,
    axis: ndarray,
    radius: float,
    sideways: ndarray,
    distance: ndarray,
    out: ndarray,
) -> None:
    """Signed distance (negative inside) and unit direction away from the axis segment; `sideways` for points
    on the segment itself."""
    square = axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]
    away = start[0] * start[0] + start[1] * start[1] + start[2] * start[2]
    least = ON_AXIS * (radius + np.sqrt(square) + np.sqrt(away))
    for l in range(len(points)):
        x, y, z = points[l, 0] - start[0], points[l, 1] - start[1], points[l, 2] - start[2]
        along = (
            min(max((x * axis[0] + y * axis[1] + z * axis[2]) / square, 0.0), 1.0) if square > 0.0 else 0.0
        )
        x, y, z = x - along * axis[0], y - along * axis[1], z - along * axis[2]
        reach = np.sqrt(x * x + y * y + z * z)
        distance[l] = reach - radius
        if reach > least:
            out[l, 0], out[l, 1], out[l, 2] = x / reach, y / reach, z / reach
        else:
            out[l] = sideways
