"""Knot reduction with a guaranteed bound: the fewest knots a curve keeps within a tolerance (Yang & Zheng
2012, section 4).

Start from the fewest knots, insert a knot where the error is largest until it is below the tolerance; then
take knots out again, the least needed one first, as long as the tolerance holds: an early knot is often
spared by later ones. The error is not sampled: it is the largest control point of the difference curve on
fine knots, which bounds the difference everywhere.
"""

import numpy as np
import scipy.linalg as la
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.basis.periodic import FEWEST
from bonecam.surface.basis.spline_space import collocation, sites

REWEIGHTED_BELOW = 1.6
"""A least-squares fit whose largest error is from one to this many tolerances is fitted again with other
weights."""

MAX_REWEIGHTINGS = 5
"""Times that one curve is fitted again with other weights at most."""

MAX_NEEDED = 6
"""So many needed knots in a row end the search for knots that can be taken out."""


class Reduction:
    """Reduces curves given on the `fine` knots to subsets of the `candidates` among them; open curves keep
    their ends."""

    def __init__(self, fine: Float[ndarray, " k"], candidates: Float[ndarray, " c"], closed: bool) -> None:
        self.candidates = candidates
        self.closed = closed
        self._sites = sites(fine, closed)
        self._weights = _closed_steps(self._sites) if closed else np.gradient(self._sites)
        self._to_fine = la.inv(collocation(fine, self._sites, closed))

    def least(self, points: Float[ndarray, "n ... d"], tolerance: float) -> tuple[ndarray, ndarray]:
        """Kept knots and control points of a curve that differs from the given one by less than `tolerance`
        everywhere.

        Several curves (n, c, d) keep the same knots, which suffice for each: what a tensor product needs.
        """
        flat = points.reshape(len(points), -1)
        curves = points.size // len(points) // points.shape[-1]
        kept = self._remove_knots(self._insert_knots(flat, curves, tolerance), flat, curves, tolerance)
        return self.candidates[kept], self._fit(kept, flat, curves, tolerance)[0].reshape(
            -1, *points.shape[1:]
        )

    def _fit(
        self, kept: ndarray, points: ndarray, curves: int, tolerance: float
    ) -> tuple[ndarray, Float[ndarray, " n"]]:
        """The control points on the kept candidates that fit best, and the largest error of all curves at
        each fine control point.

        Where least squares miss the tolerance narrowly, weights that grow with the error (Lawson 1961) lower
        the largest error.
        """
        matrix = self._to_fine @ collocation(self.candidates[kept], self._sites, self.closed)
        weights = self._weights
        best = self._solve(matrix, points, weights)
        least = np.inf
        found = best
        for _ in range(1 + MAX_REWEIGHTINGS):
            difference = (matrix @ found - points).reshape(len(points), curves, -1)
            now = np.linalg.norm(difference, axis=2).max(axis=1)
            if now.max() < least:
                best = found
                error = now
                least = now.max()
            if not tolerance <= least < REWEIGHTED_BELOW * tolerance:
                break
            weights = weights * (now / now.max() + 1e-3)
            found = self._solve(matrix, points, weights)
        return best, error

    def _solve(self, matrix: ndarray, points: ndarray, weights: ndarray) -> ndarray:
        """Control points by weighted least squares; the ends of open curves stay."""
        if self.closed:
            return _least_squares(matrix, points, weights)
        inner = points - matrix[:, [0, -1]] @ points[[0, -1]]
        return np.vstack([points[:1], _least_squares(matrix[:, 1:-1], inner, weights), points[-1:]])

    def _insert_knots(self, points: ndarray, curves: int, tolerance: float) -> ndarray:
        """The fewest candidates to begin with and those inserted at the peaks of the error, until it is below
        the tolerance everywhere."""
        count = len(self.candidates)
        kept = (
            np.unique(np.linspace(0, count, FEWEST, endpoint=False).astype(np.int64))
            if self.closed
            else np.empty(0, dtype=np.int64)
        )
        while len(kept) < count:
            error = self._fit(kept, points, curves, tolerance)[1]
            if error.max() < tolerance:
                break
            peaks = self._sites[np.flatnonzero(self._peaks(error) & (error >= tolerance))]
            free = np.setdiff1d(np.arange(count), kept)
            kept = np.union1d(kept, free[self._distances(self.candidates[free], peaks).argmin(axis=0)])
        return kept

    def _remove_knots(self, kept: ndarray, points: ndarray, curves: int, tolerance: float) -> ndarray:
        """The kept candidates without those that can be spared, tried in the order of the error without them,
        until MAX_NEEDED in a row cannot be spared."""
        if len(kept) <= (FEWEST if self.closed else 0):
            return kept
        lacks = [self._fit(np.delete(kept, k), points, curves, 0.0)[1].max() for k in range(len(kept))]
        needed = 0
        for knot in kept[np.argsort(lacks, kind="stable")]:
            tried = kept[kept != knot]
            if self._fit(tried, points, curves, tolerance)[1].max() < tolerance:
                kept = tried
                needed = 0
            else:
                needed += 1
            if needed == MAX_NEEDED or len(kept) <= (FEWEST if self.closed else 0):
                break
        return kept

    def _distances(self, a: ndarray, b: ndarray) -> ndarray:
        """Distances (len(a), len(b)) between parameters, the short way round a closed curve."""
        away: ndarray = np.abs(a[:, None] - b)
        return np.minimum(away, 1 - away) if self.closed else away

    def _peaks(self, values: Float[ndarray, " n"]) -> ndarray:
        """Where a value is no smaller than its two neighbours."""
        before, after = np.roll(values, 1), np.roll(values, -1)
        if not self.closed:
            before[0] = after[-1] = -np.inf
        return (values >= before) & (values >= after)


def _closed_steps(sites: ndarray) -> ndarray:
    """Half the distance from the site before to the site behind, round a closed curve."""
    return (np.diff(sites, prepend=sites[-1] - 1) + np.diff(sites, append=sites[0] + 1)) / 2


def _least_squares(matrix: ndarray, points: ndarray, weights: ndarray) -> ndarray:
    """Weighted least squares by normal equations; one step of iterative refinement restores the digits they
    lose."""
    weighted = matrix * (weights / weights.sum())[:, None]
    factor = la.cho_factor(weighted.T @ matrix)
    found = la.cho_solve(factor, weighted.T @ points)
    return np.asarray(found + la.cho_solve(factor, weighted.T @ (points - matrix @ found)))
