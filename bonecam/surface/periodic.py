"""Periodic cubic splines in one parameter on [0, 1): collocation, interpolation, and knot reduction with a guaranteed bound.

A curve is given by its distinct knots (r,) and as many control points (r, d); control point i belongs to the function that is centred
on knot i. The reduction keeps a subset of the knots (Yang & Zheng 2012, section 4): start from few, insert the knot where the
error is largest until it is below the tolerance. The error is not sampled: it is the largest control point of the difference curve
on the full knots, which bounds the difference everywhere.
"""

import numpy as np
import scipy.linalg as la
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.knots import span_functions

FEWEST = 4  # a closed cubic needs four distinct knots


def collocation(knots: Float[ndarray, " r"], s: Float[ndarray, " n"]) -> Float[ndarray, "n r"]:
    """The periodic functions on `knots` at the parameters `s`; one knot means the constant 1."""
    matrix = np.zeros((len(s), len(knots)))
    if len(knots) == 1:
        return matrix + 1.0
    s = np.mod(s, 1.0)
    span = np.searchsorted(knots, s, side="right") - 1
    window = span[:, None] + np.arange(-3, 5)
    unwrapped = knots[window % len(knots)] + window // len(knots)
    values = span_functions(unwrapped, s, 0)[0]
    np.add.at(matrix, (np.arange(len(s))[:, None], (span[:, None] + np.arange(-1, 3)) % len(knots)), values)
    return matrix


def interpolate(parameters: Float[ndarray, " p"], points: Float[ndarray, "p d"]) -> Float[ndarray, "p d"]:
    """Control points of the periodic C2 cubic through `points` at `parameters`, which are its knots too."""
    found: ndarray = la.solve(collocation(parameters, parameters), points)
    return found


def insertion(coarse: Float[ndarray, " c"], fine: Float[ndarray, " r"]) -> Float[ndarray, "r c"]:
    """Knot insertion: control points on `fine` = insertion @ control points on `coarse`; `fine` must contain `coarse`."""
    found: ndarray = la.solve(collocation(fine, fine), collocation(coarse, fine))
    return found


def reduce(knots: Float[ndarray, " r"], points: Float[ndarray, "r d"], tolerance: float) -> tuple[ndarray, ndarray]:
    """Fewer of the knots, and control points on them, so that the curve moves less than `tolerance` anywhere.

    A curve that stays within `tolerance` of one point becomes that point: knots [0].
    """
    middle = points.mean(axis=0, keepdims=True)
    if np.linalg.norm(points - middle, axis=1).max() < tolerance:
        return np.zeros(1), middle
    kept = np.unique(np.linspace(0, len(knots), FEWEST, endpoint=False).astype(np.int64))
    while len(kept) < len(knots):
        matrix = insertion(knots[kept], knots)
        found = la.lstsq(matrix, points)[0]
        error = np.linalg.norm(matrix @ found - points, axis=1)
        if error.max() < tolerance:
            return knots[kept], found
        free = np.setdiff1d(np.flatnonzero(_peaks(error) & (error >= tolerance)), kept)
        if not len(free):
            free = np.setdiff1d(np.arange(len(knots)), kept)
            free = free[[int(np.argmax(error[free]))]]
        kept = np.union1d(kept, free)
    return knots, points


def _peaks(values: Float[ndarray, " r"]) -> ndarray:
    """Where a value is no smaller than its two periodic neighbours."""
    return (values >= np.roll(values, 1)) & (values >= np.roll(values, -1))
