"""Area and enclosed volume of a T-spline by Gauss quadrature on its Bezier elements.

area = int |S_s x S_t| ds dt; volume = int S . (S_s x S_t) / 3 ds dt (divergence theorem; closed, outward
surfaces).
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.tmesh.surface import Surface

AREA_ORDER = 12  # the root of a rational: no finite order is exact
VOLUME_ORDER = 6  # exact for polynomial patches


def area(surface: Surface) -> float:
    """Surface area, mm^2."""
    _, S_s, S_t, weights = _quadrature(surface, AREA_ORDER)
    return float(np.linalg.norm(np.cross(S_s, S_t), axis=1) @ weights)


def volume(surface: Surface) -> float:
    """Enclosed volume, mm^3, > 0 where S_s x S_t points outward; of a closed surface only."""
    S, S_s, S_t, weights = _quadrature(surface, 2 * VOLUME_ORDER if np.ptp(surface.weights) else VOLUME_ORDER)
    S = S - surface.control_points.mean(axis=0)
    return float(np.einsum("ni,ni->n", S, np.cross(S_s, S_t)) @ weights / 3)


def _quadrature(
    surface: Surface, order: int
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"], ndarray]:
    """S, S_s, S_t at order x order Gauss points of every element, and their weights."""
    x, w = np.polynomial.legendre.leggauss(order)
    boxes = surface.elements().boxes
    half = np.column_stack([boxes[:, 1] - boxes[:, 0], boxes[:, 3] - boxes[:, 2]]) / 2
    u, v = (a.ravel() for a in np.meshgrid(x, x))
    s = ((boxes[:, 0] + half[:, 0])[:, None] + half[:, :1] * u).ravel()
    t = ((boxes[:, 2] + half[:, 1])[:, None] + half[:, 1:] * v).ravel()
    element = np.repeat(np.arange(len(boxes), dtype=np.int32), order * order)
    found = surface.elements().derivatives(surface.patches, element, s, t, 1)
    weights = (half.prod(axis=1)[:, None] * np.outer(w, w).ravel()).ravel()
    return found[0], found[1], found[2], weights
