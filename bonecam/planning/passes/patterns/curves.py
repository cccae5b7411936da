"""Curves on a surface: the lines of every pattern, as knots (s, t) joined by smooth interpolation.

Between two knots a curve is the cubic Hermite polynomial whose tangents are the central differences of the knots
(Catmull and Rom 1974); a curve of two knots is straight in (s, t), so iso-parametric lines are exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import frozen


@dataclass(frozen=True, eq=False)
class Curves:
    """Curves in machining order: knot i (s, t) is one of curve `line[i]`, which never decreases; curve c belongs to
    `group[c]`, which never decreases either. Within a group the order is open (`order.py`).

    Each curve has two knots at least and runs so that what is to be cut after it lies on its right, seen from
    outside: a cutter that turns clockwise climbs. s is not wrapped at a seam. A place on a curve is told by `x`, the
    number of the knot before it plus the share of the way to the next one.
    """

    line: Int[ndarray, " k"]
    knots: Float[ndarray, "k 2"]
    group: Int[ndarray, " c"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "line", frozen(self.line, np.int64))
        object.__setattr__(self, "knots", frozen(self.knots))
        object.__setattr__(self, "group", frozen(self.group, np.int64))

    @cached_property
    def first(self) -> Int[ndarray, " c"]:
        """The first knot of each curve."""
        return np.flatnonzero(np.r_[True, self.line[1:] != self.line[:-1]])

    @cached_property
    def last(self) -> Int[ndarray, " c"]:
        """The last knot of each curve."""
        return np.flatnonzero(np.r_[self.line[1:] != self.line[:-1], True])

    @cached_property
    def tangents(self) -> Float[ndarray, "k 2"]:
        """d(s, t)/dx at each knot."""
        steps = np.diff(self.knots, axis=0)
        before, after = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
        before[self.first], after[self.last] = after[self.first], before[self.last]
        return (before + after) / 2

    def at(
        self, line: Int[ndarray, " n"], x: Float[ndarray, " n"]
    ) -> tuple[Float[ndarray, "n 2"], Float[ndarray, "n 2"]]:
        """Parameters (s, t) at the places `x` of the curves `line`, and their tangents d(s, t)/dx."""
        i = np.clip(x.astype(np.int64), self.first[line], self.last[line] - 1)
        f = (x - i)[:, None]
        a, b = self.knots[i], self.knots[i + 1]
        u, v = self.tangents[i], self.tangents[i + 1]
        # the Hermite polynomial in powers of f
        square = 3 * (b - a) - 2 * u - v
        cube = 2 * (a - b) + u + v
        return a + f * (u + f * (square + f * cube)), u + f * (2 * square + 3 * f * cube)


def curves_of(knots: Sequence[Float[ndarray, "_ 2"]], group: Int[ndarray, " c"] | None = None) -> Curves:
    """The curves through these knots, one array each; without groups their order is fixed."""
    counts = [len(each) for each in knots]
    numbers = np.arange(len(knots))
    return Curves(np.repeat(numbers, counts), np.vstack(knots), numbers if group is None else group)


def ranges(kept: Bool[ndarray, " n"], short: float) -> list[tuple[int, int]]:
    """First place and end (exclusive) of each range of kept places, wider by one place on both sides; gaps of less
    than `short` places are closed."""
    change = np.diff(np.r_[0, kept.astype(np.int64), 0])
    starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    apart = np.flatnonzero(starts[1:] - ends[:-1] >= short)
    starts, ends = starts[np.r_[0, apart + 1]], ends[np.r_[apart, len(ends) - 1]]
    return [(max(int(a) - 1, 0), min(int(b) + 1, len(kept))) for a, b in zip(starts, ends)]
