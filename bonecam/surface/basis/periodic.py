"""Periodic cubic splines in one parameter on [0, 1): collocation.

A curve is given by its distinct knots (r,) and as many control points (r, d); control point i belongs to the
function that is centred on knot i.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.basis.knots import span_functions

FEWEST = 4
"""A closed cubic needs four distinct knots."""


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
