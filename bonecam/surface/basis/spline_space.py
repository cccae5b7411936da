"""Cubic splines in one parameter on [0, 1], closed or open: collocation, interpolation and knot insertion.

A space is told by its `knots`: closed, the distinct periodic knots in [0, 1), as many control points; open,
the knots inside (0, 1) without the fourfold ends, four control points more. Matrices are sparse: four functions
live at a parameter.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse.linalg import splu

from bonecam.surface.basis import periodic
from bonecam.surface.basis.knots import span_functions


def clamped(inner: Float[ndarray, " k"]) -> Float[ndarray, " k8"]:
    """The inner knots with 0 and 1 four times at the ends."""
    return np.concatenate([np.zeros(4), inner, np.ones(4)])


def sites(knots: Float[ndarray, " k"], closed: bool) -> Float[ndarray, " n"]:
    """One parameter for each control point at which interpolation is well posed: the knots, or the averages
    of three."""
    return knots if closed else _open_arguments(knots).mean(axis=1)


def collocation(knots: Float[ndarray, " k"], s: Float[ndarray, " n"], closed: bool) -> sp.csr_array:
    """The functions of the space at s: (n, c)."""
    if closed:
        values, functions = periodic.functions_at(knots, s)
        return _sparse(values, functions, len(knots))
    span, window = _open_spans(knots, s)
    return _sparse(span_functions(window, s, 0)[0], span[:, None] + np.arange(-3, 1), len(knots) + 4)


def insertion(knots: Float[ndarray, " k"], fine: Float[ndarray, " f"], closed: bool) -> sp.csr_array:
    """The control points on `fine`, which holds all the knots, of a curve on `knots`: (n, c).

    Control point i is the curve's blossom at the three inner knots of function i (Ramshaw 1989), by de Boor's triangle
    on the four unit coefficient vectors.
    """
    at = sites(fine, closed)
    if closed:
        span, window = periodic.spans(knots, at)
        functions = (span[:, None] + np.arange(-1, 3)) % len(knots)
        arguments = np.column_stack([np.roll(fine, 1), fine, np.roll(fine, -1)])
        arguments[0, 0] -= 1
        arguments[-1, 2] += 1
    else:
        span, window = _open_spans(knots, at)
        functions = span[:, None] + np.arange(-3, 1)
        arguments = _open_arguments(fine)
    shares = np.broadcast_to(np.eye(4), (len(at), 4, 4))  # [control point, de Boor point, function]
    for r in (1, 2, 3):
        left, right = window[:, r:4], window[:, 4 : 8 - r]
        ratio = ((arguments[:, r - 1, None] - left) / (right - left))[:, :, None]
        shares = shares[:, :-1] * (1 - ratio) + shares[:, 1:] * ratio
    return _sparse(shares[:, 0], functions, len(knots) + 4 * (not closed))


def _open_arguments(knots: ndarray) -> Float[ndarray, "n 3"]:
    """The three inner knots of each function of an open space."""
    return np.lib.stride_tricks.sliding_window_view(clamped(knots)[1:-1], 3)


def _open_spans(knots: ndarray, s: ndarray) -> tuple[Int[ndarray, " n"], Float[ndarray, "n 8"]]:
    """The knot span of each parameter in an open space, and the four knots round it on either side."""
    whole = clamped(knots)
    span = np.clip(np.searchsorted(whole, s, side="right") - 1, 3, len(whole) - 5)
    return span, whole[span[:, None] + np.arange(-3, 5)]


def _sparse(values: Float[ndarray, "n 4"], functions: Int[ndarray, "n 4"], count: int) -> sp.csr_array:
    """The matrix (n, count) with these values in these columns; those of one place add up."""
    starts = np.arange(0, 4 * len(values) + 1, 4)
    matrix = sp.csr_array((values.ravel(), functions.ravel(), starts), shape=(len(values), count))
    matrix.sum_duplicates()
    return matrix


def curve_knots(s: Float[ndarray, " p"], closed: bool) -> Float[ndarray, " k"]:
    """Knots of the interpolating cubic at parameters s: s itself, or without the second and the last but one
    (not a knot)."""
    return s if closed else s[2:-2]


def interpolate(
    knots: Float[ndarray, " k"], s: Float[ndarray, " p"], points: Float[ndarray, "p d"], closed: bool
) -> Float[ndarray, "p d"]:
    """Control points of the cubic on `knots` through `points` at s."""
    return np.asarray(splu(collocation(knots, s, closed).tocsc()).solve(points))
