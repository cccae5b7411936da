"""Cubic B-spline basis functions on given knots (Cox-de Boor), many spans at once."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray


def fault(knots: ndarray) -> str:
    """Which knot is not finite, or below the one before it; nothing where none is."""
    if not np.isfinite(knots).all():
        return f": knot {int(np.argmin(np.isfinite(knots)))} is not finite"
    falls = np.flatnonzero(np.diff(knots) < 0)
    return f": knot {falls[0] + 1} ({knots[falls[0] + 1]:g}) is below the one before it" if len(falls) else ""


def _lifted(lower: ndarray, knots: ndarray, x: ndarray, degree: int) -> ndarray:
    """The functions of `degree` on one span from those of `degree - 1`: A2.2 of The NURBS Book,
    vectorised."""
    functions = np.zeros((len(x), degree + 1))
    for i in range(degree):
        left = knots[:, 4 - degree + i]
        right = knots[:, 4 + i]
        ratio = lower[:, i] / (right - left)
        functions[:, i] += ratio * (right - x)
        functions[:, i + 1] += ratio * (x - left)
    return functions


def _differences(lower: ndarray, knots: ndarray, degree: int) -> ndarray:
    """d/dx of the functions of `degree`, given (derivatives of) those of `degree - 1`."""
    functions = np.zeros((len(lower), degree + 1))
    for i in range(degree):
        ratio = degree * lower[:, i] / (knots[:, 4 + i] - knots[:, 4 - degree + i])
        functions[:, i] -= ratio
        functions[:, i + 1] += ratio
    return functions


def span_functions(knots: Float[ndarray, "n 8"], x: Float[ndarray, " n"], order: int) -> Float[ndarray, "c n 4"]:
    """The four cubics that live on the span [knots[:, 3], knots[:, 4]] at x, and their derivatives up to
    `order`.

    Row d holds the d-th derivatives. The span must not be empty.
    """
    one = np.ones((len(x), 1))
    linear = _lifted(one, knots, x, 1)
    quadratic = _lifted(linear, knots, x, 2)
    result = [_lifted(quadratic, knots, x, 3)]
    if order > 0:
        result.append(_differences(quadratic, knots, 3))
    if order > 1:
        result.append(_differences(_differences(linear, knots, 2), knots, 3))
    return np.array(result)


def bernstein_coefficients(
    knots: Float[ndarray, "n 8"], low: Float[ndarray, " n"], high: Float[ndarray, " n"]
) -> Float[ndarray, "n 4 4"]:
    """Bernstein coefficients on [low, high] of the four cubics that live on the span [knots[:, 3], knots[:,
    4]].

    Result[n, f, i]: coefficient i of function f: the blossom of f at (low, low, low), (low, low, high), (low,
    high, high), (high, high, high) (Ramshaw 1989), by de Boor's triangle on the four unit coefficient
    vectors.
    """
    result = np.empty((len(knots), 4, 4))
    for i in range(4):
        points = np.broadcast_to(np.eye(4), (len(knots), 4, 4))  # [n, de Boor point, function]
        for r in (1, 2, 3):
            x = (high if r > 3 - i else low)[:, None]
            left, right = knots[:, r:4], knots[:, 4 : 8 - r]
            ratio = ((x - left) / (right - left))[:, :, None]
            points = points[:, :-1] * (1 - ratio) + points[:, 1:] * ratio
        result[:, :, i] = points[:, 0]
    return result


def aligned(rows: Sequence[Float[ndarray, " _"]], period: float = 0.0) -> list[Float[ndarray, " _"]]:
    """Rows of knots, those that differ by rounding only made equal to the least of them; a knot just below
    the period comes to lie at 0."""
    every = np.unique(np.concatenate(rows))
    kept = distinct(every)
    lifted = distinct(np.append(kept, kept[0] + period)) if period else kept
    values = np.append(kept[:-1], kept[0]) if period and len(lifted) == len(kept) else kept
    return [values[np.searchsorted(kept, row, side="right") - 1] for row in rows]


def distinct(knots: Float[ndarray, " n"]) -> Float[ndarray, " m"]:
    """Increasing knots without those that differ from their neighbour by rounding only."""
    knots = np.unique(knots)
    tolerance = 1024 * np.finfo(float).eps * max(1.0, float(np.abs(knots).max()))
    return knots[np.concatenate([[True], np.diff(knots) > tolerance])]
