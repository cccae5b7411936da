"""Rows of points as cubic section curves: parameters by chord length, an interpolating curve for each row,
all on shared knots.

Rows with equal counts share the mean of their parameters (their columns belong together); rows with different
counts have each its own, rounded to a common grid where that keeps them apart, so that few distinct knots
come together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.basis.spline_space import collocation, curve_knots, interpolate

FEWEST_CLOSED, FEWEST_OPEN = 5, 4
"""Least number of points of a row."""
STEPS = 8, 256
"""Fewest and most grid steps in a typical distance of two parameters; coarse grids move the parameters, fine
ones make many knots."""
FINEST = 2048
"""Grid steps of all beyond the fewest."""
SAME = 1e-9
"""Knots of different rows that are no farther apart differ by rounding."""


@dataclass(frozen=True, eq=False)
class RowCurves:
    """Row i is interpolated by the cubic with knots[i] and control_points[i] that meets points[i] at
    parameters[i]."""

    closed: bool
    points: tuple[Float[ndarray, "_ 3"], ...]
    parameters: tuple[Float[ndarray, " _"], ...]
    knots: tuple[Float[ndarray, " _"], ...]
    control_points: tuple[Float[ndarray, "_ 3"], ...]

    @classmethod
    def through(cls, rows: Sequence[ndarray] | ndarray, closed: bool) -> "RowCurves":
        """Raises ValueError on rows with too few points, points that coincide or are not finite, naming row
        and point."""
        points = tuple(np.array(row, dtype=np.float64) for row in rows)
        for i, row in enumerate(points):
            _check(i, row, closed)
        parameters = shared([chord_lengths(row, closed) for row in points], closed)
        knots = tuple(curve_knots(s, closed) for s in parameters)
        control = tuple(interpolate(k, s, row, closed) for k, s, row in zip(knots, parameters, points))
        return cls(closed, points, parameters, knots, control)

    @property
    def union(self) -> Float[ndarray, " k"]:
        """All distinct knots of all rows, increasing."""
        return distinct(np.concatenate(self.knots), SAME)

    def at(self, s: Float[ndarray, " n"]) -> Float[ndarray, "m n 3"]:
        """All curves at the same parameters."""
        return np.array([collocation(k, s, self.closed) @ c for k, c in zip(self.knots, self.control_points)])


def distinct(knots: Float[ndarray, " n"], apart: float) -> Float[ndarray, " k"]:
    """Knots in [0, 1), increasing, of those that are no farther apart, across the seam too, only one."""
    knots = np.unique(knots)
    knots = knots[np.diff(knots, prepend=-1.0) > apart]
    return knots[knots - knots.min(initial=1.0) < 1 - apart]


def _check(number: int, row: ndarray, closed: bool) -> None:
    if row.ndim != 2 or row.shape[1] != 3:
        raise ValueError(f"row {number} has the shape {row.shape}: give points (p, 3)")
    fewest = FEWEST_CLOSED if closed else FEWEST_OPEN
    if len(row) < fewest:
        raise ValueError(
            f"row {number} has {len(row)} points: {'a closed' if closed else 'an open'} row needs at least {fewest}"
        )
    if not np.isfinite(row).all():
        raise ValueError(f"row {number}, point {int(np.argmin(np.isfinite(row).all(axis=1)))} is not finite")
    # Whether each point lies on the next one, to within rounding
    coincide = np.linalg.norm(_steps(row, closed), axis=1) <= 64 * np.finfo(float).eps * np.abs(row).max()
    if coincide.any():
        k = int(np.argmax(coincide))
        raise ValueError(f"row {number}: points {k} and {(k + 1) % len(row)} coincide: remove one of them")


def _steps(row: ndarray, closed: bool) -> ndarray:
    return np.roll(row, -1, axis=0) - row if closed else np.diff(row, axis=0)


def chord_lengths(row: Float[ndarray, "p 3"], closed: bool) -> Float[ndarray, " p"]:
    """Accumulated share of the row's length: from 0, to 1 in an open row."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(_steps(row, closed), axis=1))])
    share = length / length[-1]
    return share[:-1] if closed else share


def shared(parameters: list[Float[ndarray, " _"]], closed: bool) -> tuple[Float[ndarray, " _"], ...]:
    """One mean for all rows where they have equal counts, else each its own on a grid."""
    if len({len(s) for s in parameters}) == 1:
        mean = np.mean(parameters, axis=0)
        return (mean,) * len(parameters)
    typical = float(np.median(np.concatenate([np.diff(s) for s in parameters])))
    count = 2 * int(np.ceil(max(STEPS[0] / typical, min(STEPS[1] / typical, FINEST)) / 2))
    return tuple(_on_grid(s, count, closed) for s in parameters)


def _on_grid(s: ndarray, count: int, closed: bool) -> ndarray:
    """Rounded to multiples of 1 / count where that keeps all apart."""
    rounded = np.round(s * count) / count
    apart = (np.diff(rounded) > 0).all() and not (closed and rounded[-1] >= 1)
    return rounded if apart else s
