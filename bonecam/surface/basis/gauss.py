"""Gauss-Legendre quadrature on knot spans and on Bezier elements."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

CLOSED_FORMS = {1: np.array([0.5]), 2: 0.5 + np.array([-1.0, 1.0]) / np.sqrt(12)}
"""Nodes on [0, 1] of one and two points with equal weights; numpy's two are off in the last digit."""


def unit_rule(count: int) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """`count` nodes on [0, 1] and their weights (sum 1): exact for polynomials of degree 2 count - 1."""
    if count in CLOSED_FORMS:
        return CLOSED_FORMS[count], np.full(count, 1 / count)
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def span_points(breaks: Float[ndarray, " b"], count: int) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """`count` points in every interval between increasing breaks, and their weights (sum: the length)."""
    nodes, weights = unit_rule(count)
    sizes = np.diff(breaks)[:, None]
    return (breaks[:-1, None] + sizes * nodes).ravel(), (sizes * weights).ravel()


def element_points(
    boxes: Float[ndarray, "e 4"], count: int
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s and t of count x count points in every box (s_low, s_high, t_low, t_high), and their weights.

    The points of a box follow one another, s fastest; the weights add up to the area of the boxes.
    """
    nodes, weights = unit_rule(count)
    low = boxes[:, [0, 2]]
    sizes = boxes[:, [1, 3]] - low
    u, v = (x.ravel() for x in np.meshgrid(nodes, nodes))
    s = low[:, :1] + sizes[:, :1] * u
    t = low[:, 1:] + sizes[:, 1:] * v
    areas = np.outer(sizes.prod(axis=1), np.outer(weights, weights).ravel())
    return s.ravel(), t.ravel(), areas.ravel()
