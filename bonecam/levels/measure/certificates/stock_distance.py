"""How far a level is out of the stock at most, and how far inside it.

The signed distance of a convex body is convex. So its largest value at control points bounds it from above on
their patch, and its tangent plane at one point bounds it from below. (A stock given as a mesh may be off
convex by 1e-5 of its diagonal, and the bounds by as much.)
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.measure.certificates.certificate import ACCURACY, MAX_HALVINGS, ROUNDING
from bonecam.levels.measure.certificates.nets import CORNERS, quarter_nets
from bonecam.setup.stock import Stock


def bound_outside(nets: Float[ndarray, "e 16 3"], stock: Stock) -> tuple[float, Float[ndarray, "3"]]:
    """How far patches leave the stock at most (mm, negative: inside) and about where; better than zero only
    where zero is in doubt."""
    worst = reached = -np.inf
    place = np.zeros(3)
    for halving in range(MAX_HALVINGS):
        values = stock.signed_distance(nets.reshape(-1, 3)).reshape(-1, 16)
        bounds = values.max(1)
        reached = max(reached, float(values[:, CORNERS].max()))
        doubtful = (bounds > max(0.0, reached + ACCURACY)) & (halving < MAX_HALVINGS - 1)
        patch = np.argmax(np.where(doubtful, -np.inf, bounds))
        if not doubtful[patch] and bounds[patch] > worst:
            worst = float(bounds[patch])
            place = nets[patch, np.argmax(values[patch])]
        if not doubtful.any():
            break
        nets = quarter_nets(nets[doubtful])
    return worst + ROUNDING, place


def bound_inside(
    nets: Float[ndarray, "e 16 3"], stock: Stock, limit: float
) -> tuple[float, Float[ndarray, "3"]]:
    """How far inside the stock points of patches are at most (mm) and about where; better than `limit` only
    where that is in doubt."""
    worst = reached = 0.0
    place = np.zeros(3)
    for halving in range(MAX_HALVINGS):
        middles = nets.mean(1)
        corners = nets[:, CORNERS]
        distance, out = stock.distances_and_normals(middles)
        bounds = -distance - np.einsum("nkx,nx->nk", nets - middles[:, None], out).min(1)
        reached = max(reached, float(-stock.signed_distance(corners.reshape(-1, 3)).min()))
        doubtful = (bounds > max(limit, reached + ACCURACY)) & (halving < MAX_HALVINGS - 1)
        patch = np.argmax(np.where(doubtful, -np.inf, bounds))
        if not doubtful[patch] and bounds[patch] > worst:
            worst = float(bounds[patch])
            place = middles[patch]
        if not doubtful.any():
            break
        nets = quarter_nets(nets[doubtful])
    return worst + ROUNDING, place
