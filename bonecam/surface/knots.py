"""Cubic B-spline basis functions on given knots (Cox-de Boor), many spans at once."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray


def _lifted(lower: ndarray, knots: ndarray, x: ndarray, degree: int) -> ndarray:
    """The functions of `degree` on one span from those of `degree - 1`: A2.2 of The NURBS Book, vectorised."""
    functions = np.zeros((len(x), degree + 1))
    for i in range(degree):
        left, right = knots[:, 4 - degree + i], knots[:, 4 + i]
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


def span_functions(knots: Float[ndarray, "n 8"], x: Float[ndarray, "n"], order: int) -> Float[ndarray, "c n 4"]:
    """The four cubics that live on the span [knots[:, 3], knots[:, 4]] at x, and their derivatives up to `order`.

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
