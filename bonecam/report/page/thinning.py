"""Fewer rows of a path within a chord tolerance."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots


def thinned(
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    needed: Bool[ndarray, " n"],
    tolerance: float,
    length: float,
) -> Int[ndarray, " k"]:
    """Rows that are enough: tips, and the points `length` mm up the axes, lie within `tolerance` (mm) of the lines
    between neighbours. `needed` rows stay, so do the first and the last.

    Each round leaves out at most every other row, within half of the tolerance that is left.
    """
    kept = np.arange(len(tips))
    rest = tolerance
    while True:
        rest /= 2
        inner = kept[1:-1]
        far = np.maximum(_distances(tips, kept), _distances(tips + length * axes, kept))
        droppable = (far < rest) & ~needed[inner]
        droppable[1::2] = False
        if droppable.sum() < len(kept) / 100:
            return kept
        kept = np.delete(kept, 1 + np.flatnonzero(droppable))


def _distances(points: Float[ndarray, "n 3"], kept: Int[ndarray, " k"]) -> Float[ndarray, " m"]:
    """Distance of each inner point of a polyline from the segment between its neighbours, mm."""
    before = points[kept[:-2]]
    here = points[kept[1:-1]]
    after = points[kept[2:]]
    along = after - before
    square = np.maximum(dots(along, along), np.finfo(float).tiny)
    share = np.clip(dots(here - before, along) / square, 0.0, 1.0)
    return np.linalg.norm(before + share[:, None] * along - here, axis=1)
