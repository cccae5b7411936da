"""The certificate of one cut: the bounds that hold everywhere on it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import place_name
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE, NESTING_TOLERANCE, STOCK_TOLERANCE

ACCURACY = 1e-4
"""A bound is good enough up to so many mm over a distance that is reached at some point."""

SMALLEST = 1e-4
"""Pieces of patches no larger than this (mm) are not halved again."""

ROUNDING = 1e-8
"""Added to every bound (mm) for the rounding of floating point sums."""

MAX_HALVINGS = 20
"""Most passes over the patches in which those that are bounded too loosely are halved both ways."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """What holds everywhere on one cut, mm, and where that is worst: no point of either level is farther than
    `depth` from the other, no point of the inner farther than -`nesting` outside the outer (-inf where that
    is not known), no point of the outer farther than `outside` out of the stock. `too_deep` are parameters
    (s, t) of pieces of either level that may be deeper than allowed; `pieces` is how many were bounded."""

    depth: float
    nesting: float
    outside: float
    depth_place: Float[ndarray, "3"]
    nesting_place: Float[ndarray, "3"]
    outside_place: Float[ndarray, "3"]
    too_deep: Float[ndarray, "k 2"]
    pieces: int

    def shortfalls(self, limit: float) -> tuple[str, ...]:
        """What is not certain to be within the tolerances of the check, and where, for a cut of at most
        `limit` mm; nothing where the cut is certified."""
        shortfalls = []
        if self.depth > limit + DEPTH_TOLERANCE:
            place = place_name(self.depth_place)
            shortfalls.append(f"may be {self.depth:.4f} mm deep, more than {limit:g} mm, at {place}")

        if self.nesting < -NESTING_TOLERANCE:
            known = np.isfinite(self.nesting)
            behind = f"may fall behind the level before by {-self.nesting:.4f} mm"
            shortfall = behind if known else "is not proven to hold the level before"
            shortfalls.append(f"{shortfall} at {place_name(self.nesting_place)}")

        if self.outside > STOCK_TOLERANCE:
            place = place_name(self.outside_place)
            shortfalls.append(f"may leave the stock by {self.outside:.4f} mm at {place}")
        return tuple(shortfalls)
