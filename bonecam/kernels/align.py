"""Align the moves read back from a program with the rows of the tool paths: which move reaches which row, and
which lie between two rows; compiled."""

import numpy as np

from bonecam.kernels import inner_njit, njit

AXIS_WEIGHT = 80.0
"""mm a radian: between two rows the fraction of a move is found from its tool axis where that turns by more
than a radian in this length, else from its ball centre. Words of 0.001 mm and 0.001 degrees are about as
exact there."""

SMALL_ANGLE = 1e-9
"""Angles below this (rad) are interpolated on the straight line."""

FRACTION_ROUNDING = 1e-3
"""A move between two rows may fall behind the one before by this fraction: the rounding of the words."""


@inner_njit()
def _dot(a: np.ndarray, b: np.ndarray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner_njit()
def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two vectors, radians."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return np.arctan2(np.sqrt(x * x + y * y + z * z), _dot(a, b))


@inner_njit()
def _slerp(a: np.ndarray, b: np.ndarray, fraction: float) -> np.ndarray:
    """Spherical linear interpolation between two unit vectors."""
    angle = _angle(a, b)
    vector = np.empty(3)
    first = 1 - fraction
    second = fraction
    size = 1.0
    if not angle < SMALL_ANGLE:
        first = np.sin(first * angle)
        second = np.sin(fraction * angle)
        size = np.sin(angle)
    for d in range(3):
        vector[d] = (first * a[d] + second * b[d]) / size
    return vector


@inner_njit()
def _between(
    tip: np.ndarray, axis: np.ndarray, tips: np.ndarray, axes: np.ndarray, radius: float
) -> tuple[float, float, float]:
    """Fraction, tip error (mm) and axis error (rad) of a move against the path from one row to the next: the
    ball centre on the straight line, the axis on the great circle."""
    start, chord, off = np.empty(3), np.empty(3), np.empty(3)
    for d in range(3):
        start[d] = tips[0, d] + radius * axes[0, d]
        chord[d] = tips[1, d] + radius * axes[1, d] - start[d]
        off[d] = tip[d] + radius * axis[d] - start[d]
    turn = _angle(axes[0], axes[1])
    square = _dot(chord, chord)
    if turn * AXIS_WEIGHT > np.sqrt(square):
        fraction = _angle(axes[0], axis) / turn
    else:
        fraction = _dot(chord, off) / square if square > 0 else 0.0
    fraction = min(max(fraction, 0.0), 1.0)
    meant = _slerp(axes[0], axes[1], fraction)
    for d in range(3):
        end = tips[1, d] + radius * axes[1, d]
        off[d] = (1 - fraction) * start[d] + fraction * end - radius * meant[d] - tip[d]
    return fraction, np.sqrt(_dot(off, off)), _angle(meant, axis)


@njit(cache=True)
def align_moves(
    tips: np.ndarray,
    axes: np.ndarray,
    may_be_extra: np.ndarray,
    path_tips: np.ndarray,
    path_axes: np.ndarray,
    from_anywhere: np.ndarray,
    radius: np.ndarray,
    tip_tolerance: float,
    axis_tolerance: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, int]:
    """The row of the path that each move reaches, its tip error (mm) and axis error (rad), and where the
    search stopped.

    A move is given its row (>= 0); -1 where it is extra; or -2 - row where it lies between `row` - 1 and
    `row`. Moves that `may_be_extra` may come before a row that is reached `from_anywhere`, and after the last
    row. The search stops at the first move that fits nowhere: the last two answers are that move and the row
    waited for; both are the counts where every move has its place.
    """
    n, m = len(tips), len(path_tips)
    source = np.full(n, -1, dtype=np.int64)
    tip_error = np.zeros(n)
    axis_error = np.zeros(n)
    row, fraction_before = 0, 0.0
    for move in range(n):
        if row < m:
            distance = 0.0
            for d in range(3):
                distance += (path_tips[row, d] - tips[move, d]) ** 2
            distance = np.sqrt(distance)
            angle = _angle(path_axes[row], axes[move])
            if distance <= tip_tolerance and angle <= axis_tolerance:
                source[move], tip_error[move], axis_error[move] = row, distance, angle
                row = row + 1
                fraction_before = 0.0
                continue
            if row > 0:
                fraction, distance, angle = _between(
                    tips[move], axes[move], path_tips[row - 1 : row + 1], path_axes[row - 1 : row + 1], radius[row]
                )
                in_order = fraction >= fraction_before - FRACTION_ROUNDING
                if distance <= tip_tolerance and angle <= axis_tolerance and in_order:
                    source[move] = -2 - row
                    tip_error[move] = distance
                    axis_error[move] = angle
                    fraction_before = fraction
                    continue
            if from_anywhere[row] and may_be_extra[move]:
                continue
        elif may_be_extra[move]:
            continue
        return source, tip_error, axis_error, move, row
    return source, tip_error, axis_error, n, row
