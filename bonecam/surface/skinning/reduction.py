"""Knot reduction with a guaranteed bound: the fewest knots a curve keeps within a tolerance (Yang & Zheng
2012, section 4).

Start from the fewest knots, insert a knot where the error is largest until it is below the tolerance; then
take knots out again, the least needed one first, as long as the tolerance holds: an early knot is often
spared by later ones. The error is not sampled: it is the largest control point of the difference curve on
fine knots, which bounds the difference everywhere.
"""

from collections.abc import Sequence

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.surface.basis.periodic import FEWEST
from bonecam.surface.basis.spline_space import insertion, sites

REWEIGHTED_BELOW = 1.6
"""A least-squares fit whose largest error is from one to this many tolerances is fitted again with other
weights."""

MAX_REWEIGHTINGS = 5
"""Times that one curve is fitted again with other weights at most."""

MAX_NEEDED = 6
"""So many needed knots in a row end the search for knots that can be taken out."""

SPARED = 3.0
"""Removal lowers the control points of what was inserted by less: by 1.0 to 1.6 of all rows of circles with noise of
0.0001 to 1 mm, by 2.5 of a single row."""


class Reduction:
    """Reduces curves given on the `fine` knots to subsets of the `candidates` among them; open curves keep
    their ends."""

    def __init__(self, fine: Float[ndarray, " k"], candidates: Float[ndarray, " c"], closed: bool) -> None:
        self.candidates = candidates
        self.closed = closed
        self._fine = fine
        self._sites = sites(fine, closed)
        self._weights = _closed_steps(self._sites) if closed else np.gradient(self._sites)

    def least(self, points: Float[ndarray, "n ... d"], tolerance: float) -> tuple[ndarray, ndarray]:
        """Kept knots and control points of a curve that differs from the given one by less than `tolerance`
        everywhere.

        Several curves (n, c, d) keep the same knots, which suffice for each: what a tensor product needs.
        """
        reduced = self.least_of_all([points], tolerance)
        assert reduced is not None, "no number of control points is too large"
        return reduced[0]

    def least_of_all(
        self, curves: Sequence[Float[ndarray, "n ... d"]], tolerance: float, most: float = np.inf
    ) -> list[tuple[ndarray, ndarray]] | None:
        """As `least`, one after the other; None where they need more than `most` control points together.

        Curves that need many more are told by the knots inserted, before any is taken out again.
        """
        inserted: list[ndarray] = []
        size = self._size(0) * len(curves)
        for points in curves:
            kept = self._insert_knots(points, tolerance, SPARED * most - size)
            size += len(kept)
            if size > SPARED * most:
                return None
            inserted.append(kept)
        reduced = []
        size = self._size(0) * len(curves)
        for points, kept in zip(curves, inserted):
            kept = self._remove_knots(kept, points, tolerance)
            size += len(kept)
            if size > most:
                return None
            control = self._fit(kept, points, tolerance)[0]
            reduced.append((self.candidates[kept], control.reshape(-1, *points.shape[1:])))
        return reduced

    def _size(self, knots: int) -> int:
        """Control points of a curve with so many knots."""
        return knots + 4 * (not self.closed)

    def _fit(
        self, kept: Int[ndarray, " k"], points: Float[ndarray, "n ... d"], tolerance: float
    ) -> tuple[Float[ndarray, "c _"], Float[ndarray, " n"]]:
        """The control points on the kept candidates that fit best, and the largest error of all curves at
        each fine control point.

        Where least squares miss the tolerance narrowly, weights that grow with the error (Lawson 1961) lower
        the largest error.
        """
        matrix = insertion(self.candidates[kept], self._fine, self.closed)
        flat = points.reshape(len(points), -1)
        weights = self._weights
        best = self._solve(matrix, flat, weights)
        least = np.inf
        solution = best
        for _ in range(1 + MAX_REWEIGHTINGS):
            difference = (matrix @ solution - flat).reshape(len(points), -1, points.shape[-1])
            now = np.linalg.norm(difference, axis=2).max(axis=1)
            if now.max() < least:
                best = solution
                error = now
                least = now.max()
            if not tolerance <= least < REWEIGHTED_BELOW * tolerance:
                break
            weights = weights * (now / now.max() + 1e-3)
            solution = self._solve(matrix, flat, weights)
        return best, error

    def _solve(self, matrix: sp.csr_array, points: ndarray, weights: ndarray) -> ndarray:
        """Control points by weighted least squares; the ends of open curves stay."""
        if self.closed:
            return _least_squares(matrix, points, weights)
        inner = points - matrix[:, [0, -1]] @ points[[0, -1]]
        return np.vstack([points[:1], _least_squares(matrix[:, 1:-1], inner, weights), points[-1:]])

    def _insert_knots(self, points: ndarray, tolerance: float, most: float) -> Int[ndarray, " k"]:
        """The fewest candidates to begin with and those inserted at the peaks of the error, until it is below
        the tolerance everywhere, or they are more than `most`."""
        count = len(self.candidates)
        kept = (
            np.unique(np.linspace(0, count, FEWEST, endpoint=False).astype(np.int64))
            if self.closed
            else np.empty(0, dtype=np.int64)
        )
        while len(kept) < min(count, most + 1):
            error = self._fit(kept, points, tolerance)[1]
            if error.max() < tolerance:
                break
            peaks = self._sites[np.flatnonzero(self._peaks(error) & (error >= tolerance))]
            free = np.setdiff1d(np.arange(count), kept)
            kept = np.union1d(kept, free[self._nearest(self.candidates[free], peaks)])
        return kept

    def _remove_knots(self, kept: ndarray, points: ndarray, tolerance: float) -> Int[ndarray, " k"]:
        """The kept candidates without those that can be spared, tried in the order of the error without them,
        until MAX_NEEDED in a row cannot be spared."""
        if len(kept) <= (FEWEST if self.closed else 0):
            return kept
        lacks = [self._fit(np.delete(kept, k), points, 0.0)[1].max() for k in range(len(kept))]
        needed = 0
        for knot in kept[np.argsort(lacks, kind="stable")]:
            tried = kept[kept != knot]
            if self._fit(tried, points, tolerance)[1].max() < tolerance:
                kept = tried
                needed = 0
            else:
                needed += 1
            if needed == MAX_NEEDED or len(kept) <= (FEWEST if self.closed else 0):
                break
        return kept

    def _nearest(self, knots: Float[ndarray, " k"], s: Float[ndarray, " n"]) -> Int[ndarray, " n"]:
        """The number of the knot that is nearest to each parameter, the short way round a closed curve."""
        before, behind = (knots[-1] - 1, knots[0] + 1) if self.closed else (-np.inf, np.inf)
        around = np.concatenate([[before], knots, [behind]])
        right = np.searchsorted(around[1:-1], s) + 1
        nearer_left = s - around[right - 1] <= around[right] - s
        return (right - 1 - nearer_left) % len(knots)

    def _peaks(self, values: Float[ndarray, " n"]) -> ndarray:
        """Where a value is no smaller than its two neighbours."""
        before, after = np.roll(values, 1), np.roll(values, -1)
        if not self.closed:
            before[0] = after[-1] = -np.inf
        return (values >= before) & (values >= after)


def _closed_steps(sites: ndarray) -> ndarray:
    """Half the distance from the site before to the site behind, round a closed curve."""
    return (np.diff(sites, prepend=sites[-1] - 1) + np.diff(sites, append=sites[0] + 1)) / 2


def _least_squares(matrix: sp.csr_array, points: ndarray, weights: ndarray) -> ndarray:
    """Weighted least squares by normal equations; one step of iterative refinement restores the digits they
    lose."""
    weighted = (matrix * (weights / weights.sum())[:, None]).T
    normal = (weighted @ matrix).toarray()
    factor = la.cho_factor(normal)
    solution = la.cho_solve(factor, weighted @ points)
    return solution + la.cho_solve(factor, weighted @ (points - matrix @ solution))
