"""Cubic splines in one parameter on [0, 1], closed or open: collocation and interpolation.

A space is told by its `knots`: closed, the distinct periodic knots in [0, 1), as many control points; open,
the knots inside (0, 1) without the fourfold ends, four control points more.
"""

import numpy as np
import scipy.linalg as la
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.basis import periodic
from bonecam.surface.basis.knots import span_functions


def clamped(inner: Float[ndarray, " k"]) -> Float[ndarray, " k8"]:
    """The inner knots with 0 and 1 four times at the ends."""
    return np.concatenate([np.zeros(4), inner, np.ones(4)])


def sites(knots: Float[ndarray, " k"], closed: bool) -> Float[ndarray, " n"]:
    """One parameter for each control point at which interpolation is well posed: the knots, or the averages
    of three."""
    if closed:
        return knots
    whole = clamped(knots)
    return np.array([whole[i + 1 : i + 4].mean() for i in range(len(whole) - 4)])


def collocation(knots: Float[ndarray, " k"], s: Float[ndarray, " n"], closed: bool) -> Float[ndarray, "n c"]:
    """The functions of the space at s."""
    if closed:
        return periodic.collocation(knots, s)
    whole = clamped(knots)
    span = np.clip(np.searchsorted(whole, s, side="right") - 1, 3, len(whole) - 5)
    matrix = np.zeros((len(s), len(whole) - 4))
    matrix[np.arange(len(s))[:, None], span[:, None] + np.arange(-3, 1)] = span_functions(
        whole[span[:, None] + np.arange(-3, 5)], s, 0
    )[0]
    return matrix


def curve_knots(s: Float[ndarray, " p"], closed: bool) -> Float[ndarray, " k"]:
    """Knots of the interpolating cubic at parameters s: s itself, or without the second and the last but one
    (not a knot)."""
    return s if closed else s[2:-2]


def interpolate(
    knots: Float[ndarray, " k"], s: Float[ndarray, " p"], points: Float[ndarray, "p d"], closed: bool
) -> Float[ndarray, "p d"]:
    """Control points of the cubic on `knots` through `points` at s."""
    found: ndarray = la.solve(collocation(knots, s, closed), points)
    return found
