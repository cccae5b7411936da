"""How high a tool must stand for what it holds over columns about the Z axis, compiled."""

import numpy as np
from numpy import ndarray

from bonecam.kernels import njit


@njit(cache=True, nogil=True)
def highest_over(
    centres: ndarray, directions: ndarray, offsets: ndarray, squares: ndarray, heights: ndarray, least: ndarray
) -> ndarray:
    """The largest of the `heights` (d, k), in falling order for each of the `directions` (d, 3), of which the point
    `offsets` (d, k) along the direction from each of the `centres` (n, 3) is over its column: nearer to the Z axis than
    the root of `squares` (d, k). No less than `least` (d); (n, d)."""
    highest = np.empty((len(centres), len(directions)))
    for i in range(len(centres)):
        for j in range(len(directions)):
            highest[i, j] = least[j]
            for k in range(heights.shape[1]):
                if heights[j, k] <= least[j]:
                    break
                x = centres[i, 0] + offsets[j, k] * directions[j, 0]
                y = centres[i, 1] + offsets[j, k] * directions[j, 1]
                if x * x + y * y < squares[j, k]:
                    highest[i, j] = heights[j, k]
                    break
    return highest
