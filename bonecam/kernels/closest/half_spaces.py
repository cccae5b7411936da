"""The projection of points onto intersections of half-spaces, compiled."""

import numpy as np
from numpy import ndarray

from bonecam.kernels import njit

SWEEPS = 2000
"""Times that all multipliers of a point are taken anew, at most: walls of a gap of 5 degrees take as many."""
STILL = 1e-7
"""The projection has come to rest when a sweep moves it by less, mm."""


@njit(cache=True, nogil=True)
def project_on_half_spaces(points: ndarray, normals: ndarray, offsets: ndarray, farthest: float) -> ndarray:
    """The place nearest to each point (n, 3) with normals (n, k, 3) . x >= offsets (n, k); the normals have unit length
    (Hildreth 1957: ascent along one multiplier at a time).

    A half-space whose offset is minus infinity counts for nothing. NaN where the place would be `farthest` or more
    away: the half-spaces have nothing in common.
    """
    projections = points.copy()
    multipliers = np.empty(normals.shape[1])
    for i in range(len(points)):
        x, y, z = points[i]
        multipliers[:] = 0.0
        for _ in range(SWEEPS):
            moved = 0.0
            for k in range(normals.shape[1]):
                a, b, c = normals[i, k]
                lacking = offsets[i, k] - (a * x + b * y + c * z)
                change = max(lacking, -multipliers[k])
                if change != 0.0:
                    multipliers[k] += change
                    x, y, z = x + change * a, y + change * b, z + change * c
                    moved = max(moved, abs(change))
            far = (x - points[i, 0]) ** 2 + (y - points[i, 1]) ** 2 + (z - points[i, 2]) ** 2
            if far >= farthest * farthest:
                x, y, z = np.nan, np.nan, np.nan
            if not moved > STILL or not far < farthest * farthest:
                break
        projections[i, 0], projections[i, 1], projections[i, 2] = x, y, z
    return projections
