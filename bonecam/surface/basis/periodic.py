"""Periodic cubic splines in one parameter on [0, 1): collocation.

A curve is given by its distinct knots (r,) and as many control points (r, d); control point i belongs to the
function that is centred on knot i.
"""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.surface.basis.knots import span_functions

FEWEST = 4
"""A closed cubic needs four distinct knots."""


def collocation(knots: Float[ndarray, " r"], s: Float[ndarray, " n"]) -> Float[ndarray, "n r"]:
    """The periodic functions on `knots` at the parameters `s`; one knot means the constant 1."""
    matrix = np.zeros((len(s), len(knots)))
    if len(knots) == 1:
        return matrix + 1.0
    values, functions = functions_at(knots, s)
    np.add.at(matrix, (np.arange(len(s))[:, None], functions), values)
    return matrix


def functions_at(
    knots: Float[ndarray, " r"], s: Float[ndarray, " n"]
) -> tuple[Float[ndarray, "n 4"], Int[ndarray, "n 4"]]:
    """Values at the parameters `s` of the four functions on two or more `knots` that live there, and their numbers."""
    s = np.mod(s, 1.0)
    span, window = spans(knots, s)
    return span_functions(window, s, 0)[0], (span[:, None] + np.arange(-1, 3)) % len(knots)


def spans(knots: Float[ndarray, " r"], s: Float[ndarray, " n"]) -> tuple[Int[ndarray, " n"], Float[ndarray, "n 8"]]:
    """The last knot at or below each parameter in [0, 1), and the four knots round it on either side, unwrapped."""
    span = np.searchsorted(knots, s, side="right") - 1
    window = span[:, None] + np.arange(-3, 5)
    return span, knots[window % len(knots)] + window // len(knots)
