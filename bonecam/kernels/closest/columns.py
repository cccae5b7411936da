"""Distances of points to upright cylinders, compiled: rows of `columns` (m, 5) are radius, top, bottom, x and y, mm."""

import numpy as np
from numpy import ndarray

from bonecam.kernels import njit


@njit(cache=True, nogil=True)
def column_bound(points: ndarray, columns: ndarray, distance: ndarray) -> None:
    """Lower each `distance` (n,), mm, to the signed one of its point (n, 3) from the nearest solid column, if that is
    less."""
    for i in range(len(points)):
        for c in range(len(columns)):
            out = np.hypot(points[i, 0] - columns[c, 3], points[i, 1] - columns[c, 4]) - columns[c, 0]
            up = max(points[i, 2] - columns[c, 1], columns[c, 2] - points[i, 2])
            away = min(max(out, up), 0.0) + np.hypot(max(out, 0.0), max(up, 0.0))
            distance[i] = min(distance[i], away)
