"""Area and enclosed volume of a T-spline by Gauss quadrature on its Bezier elements.

area = int |S_s x S_t| ds dt; volume = int S . (S_s x S_t) / 3 ds dt (divergence theorem; closed, outward
surfaces).
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.basis.gauss import element_points
from bonecam.surface.tmesh.surface import Surface

AREA_POINTS = 12
"""Gauss points each way: |S_s x S_t| is the root of a rational function, which no finite number integrates."""

VOLUME_POINTS = 6
"""Gauss points each way that are exact where the weights are equal; rational surfaces take twice as many."""


def area(surface: Surface) -> float:
    """Surface area, mm^2."""
    _, S_s, S_t, weights = _at_gauss_points(surface, AREA_POINTS)
    return float(np.linalg.norm(np.cross(S_s, S_t), axis=1) @ weights)


def volume(surface: Surface) -> float:
    """Enclosed volume, mm^3, > 0 where S_s x S_t points outward; of a closed surface only."""
    rational = np.ptp(surface.weights) > 0
    S, S_s, S_t, weights = _at_gauss_points(surface, 2 * VOLUME_POINTS if rational else VOLUME_POINTS)
    S = S - surface.control_points.mean(axis=0)
    return float(np.einsum("ni,ni->n", S, np.cross(S_s, S_t)) @ weights / 3)


def _at_gauss_points(
    surface: Surface, count: int
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, " n"]]:
    """S, S_s, S_t at count x count Gauss points of every element, and their weights."""
    elements = surface.elements()
    s, t, weights = element_points(elements.boxes, count)
    element = np.repeat(np.arange(len(elements.boxes), dtype=np.int32), count * count)
    S, S_s, S_t = elements.derivatives(surface.patches, element, s, t, 1)
    return S, S_s, S_t, weights
