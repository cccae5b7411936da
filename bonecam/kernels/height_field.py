"""A height field on a grid of lines, lowered by balls, compiled.

Line (i, j) begins at base[i, j] and runs along the unit axis[i]; its height is where the material on it ends.
"""

import numpy as np
from numpy import ndarray

from bonecam.kernels import njit


@njit(cache=True, nogil=True)
def _lowest(base: ndarray, axis: ndarray, centre: ndarray, square: float) -> float:
    """Where a line enters a ball, from below; infinite where it misses."""
    x, y, z = centre[0] - base[0], centre[1] - base[1], centre[2] - base[2]
    along = x * axis[0] + y * axis[1] + z * axis[2]
    rest = square - (x * x + y * y + z * z - along * along)
    return along - np.sqrt(rest) if rest > 0.0 else np.inf


@njit(cache=True, nogil=True)
def lower(heights: ndarray, bases: ndarray, axes: ndarray, centres: ndarray, windows: ndarray, radius: float) -> None:
    """Lower the `heights` (a, b) to where balls cut the lines.

    The window of a ball is its first and last line each way; lines across are counted round.
    """
    square = radius * radius
    count = heights.shape[0]
    for c in range(len(centres)):
        first, last, begin, end = windows[c]
        for k in range(first, last + 1):
            i = k % count
            for j in range(begin, end + 1):
                low = _lowest(bases[i, j], axes[i], centres[c], square)
                if low < heights[i, j]:
                    heights[i, j] = low


@njit(cache=True, nogil=True)
def cut_heights(
    heights: ndarray,
    bottoms: ndarray,
    bases: ndarray,
    axes: ndarray,
    centres: ndarray,
    windows: ndarray,
    radius: float,
    cut: ndarray,
) -> None:
    """Set `cut` (n,) to the largest height of material that each ball alone would remove from a line; lines
    that end at their bottoms are empty."""
    square = radius * radius
    count = heights.shape[0]
    for c in range(len(centres)):
        first, last, begin, end = windows[c]
        most = 0.0
        for k in range(first, last + 1):
            i = k % count
            for j in range(begin, end + 1):
                if heights[i, j] > bottoms[i, j]:
                    low = _lowest(bases[i, j], axes[i], centres[c], square)
                    most = max(most, heights[i, j] - max(low, bottoms[i, j]))
        cut[c] = most
