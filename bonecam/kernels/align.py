"""Laying a sequence of moves along the rows of tool paths: which move reaches which row, which lie between
two rows."""

import numpy as np
from numba import njit

# how far a move has come between two rows is told by its axis where that turns by more than a radian in this
# many mm, else by its ball centre: with words of 0.001 mm and 0.001 deg both then tell it to within those
# roundings
AXIS_WEIGHT = 80.0


@njit(cache=True)
def _turned(a: np.ndarray, b: np.ndarray, part: float) -> np.ndarray:
    cross = np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    angle = np.arctan2(np.sqrt(np.sum(cross * cross)), np.sum(a * b))
    if angle < 1e-9:
        return (1 - part) * a + part * b
    return (np.sin((1 - part) * angle) * a + np.sin(part * angle) * b) / np.sin(angle)


@njit(cache=True)
def _angle(a: np.ndarray, b: np.ndarray) -> float:
    cross = np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    return np.arctan2(np.sqrt(np.sum(cross * cross)), np.sum(a * b))


@njit(cache=True)
def _between(
    tip: np.ndarray, axis: np.ndarray, tips: np.ndarray, axes: np.ndarray, radius: float
) -> tuple[float, float, float]:
    """Fraction, tip error and axis error of a move against the straight way of the ball centre between two
    rows."""
    start, end = tips[0] + radius * axes[0], tips[1] + radius * axes[1]
    whole = _angle(axes[0], axes[1])
    way = end - start
    if whole * AXIS_WEIGHT > np.sqrt(np.sum(way * way)):
        part = _angle(axes[0], axis) / whole
    else:
        size = np.sum(way * way)
        part = np.sum(way * (tip + radius * axis - start)) / size if size > 0 else 0.0
    part = min(max(part, 0.0), 1.0)
    meant = _turned(axes[0], axes[1], part)
    off = (1 - part) * start + part * end - radius * meant - tip
    return part, np.sqrt(np.sum(off * off)), _angle(meant, axis)


@njit(cache=True)
def align(
    tips: np.ndarray,
    axes: np.ndarray,
    loose: np.ndarray,
    path_tips: np.ndarray,
    path_axes: np.ndarray,
    fresh: np.ndarray,
    radius: np.ndarray,
    tip_tolerance: float,
    axis_tolerance: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, int]:
    """Row reached (>= 0), or -1 for a loose move before a fresh row, or -2 - row for a move on the way to
    `row`; errors; stop.

    `loose` moves may come before a row that is `fresh` (reached from anywhere) and after the last.
    Stops at the first move that fits nowhere: the last two answers are that move and the row
    waited for; both are the counts where all is well.
    """
    n, m = len(tips), len(path_tips)
    source, tip_error, axis_error = np.full(n, -1, dtype=np.int64), np.zeros(n), np.zeros(n)
    row, before = 0, 0.0
    for move in range(n):
        if row < m:
            off = path_tips[row] - tips[move]
            distance, lean = np.sqrt(np.sum(off * off)), _angle(path_axes[row], axes[move])
            if distance <= tip_tolerance and lean <= axis_tolerance:
                source[move], tip_error[move], axis_error[move] = row, distance, lean
                row, before = row + 1, 0.0
                continue
            if row > 0:
                part, distance, lean = _between(
                    tips[move],
                    axes[move],
                    path_tips[row - 1 : row + 1],
                    path_axes[row - 1 : row + 1],
                    radius[row],
                )
                if distance <= tip_tolerance and lean <= axis_tolerance and part >= before - 1e-3:
                    source[move], tip_error[move], axis_error[move] = -2 - row, distance, lean
                    before = part
                    continue
            if fresh[row] and loose[move]:
                continue
        elif loose[move]:
            continue
        return source, tip_error, axis_error, move, row
    return source, tip_error, axis_error, n, row
