"""Where a part lies best in a stock of given size: so that the largest distance from the stock to the part,
and with it K_min, is least.

Shifts across the axis are searched (Nelder & Mead 1965, fixed start and steps: the same answer every time).
Turns and shifts along the axis would lower K_min further, but measured they leave more to be cut at the ends,
where control points are few.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from bonecam.setup.stock import Stock

CHORD = 0.1
"""Chord tolerance, mm, of the stock's mesh on which the largest distance is measured."""
TRIALS = 120
"""Most shifts that are tried."""
FIRST_STEP = 0.2
"""Size of the first simplex, mm."""
PENALTY = 10.0
"""Weight of a mm that the material over the part is too thin, against a mm of distance."""
SPARE = 0.1
"""Material asked for beyond the margin, mm."""


def centring_shift(points: Float[ndarray, "n 3"], stock: Stock, margin: float) -> Float[ndarray, "4 4"]:
    """The translation (4, 4) of the part's points across the Z axis after which the farthest point of the stock
    is nearest to them.

    At least `margin` mm of material stay over the part (as much as there is where that is less).
    """
    surface = stock.mesh(CHORD).vertices
    tree = cKDTree(points)
    room = min(margin + SPARE, -float(stock.signed_distance(points).max()))

    def cost(x: ndarray) -> float:
        shift = np.append(x, 0.0)
        lack = max(0.0, room + float(stock.signed_distance(points + shift).max()))
        return float(np.max(tree.query(surface - shift)[0])) + PENALTY * lack

    start = FIRST_STEP * np.vstack([np.zeros(2), np.eye(2)])
    solution = minimize(
        cost, np.zeros(2), method="Nelder-Mead", options={"maxfev": TRIALS, "initial_simplex": start}
    )
    transform = np.eye(4)
    if solution.fun < cost(np.zeros(2)):
        transform[:2, 3] = solution.x
    return transform
