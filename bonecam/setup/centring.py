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

from bonecam.job import StockJob
from bonecam.setup.stock import Stock

CHORD, TRIALS, SHIFT = 0.1, 120, 0.2
PENALTY, SPARE = 10.0, 0.1


def is_free(job: StockJob) -> bool:
    """Whether the size of a capsule is given and how the part lies in it is not."""
    placed = (job.offset_x, job.offset_y, job.offset_z, job.tilt_x_deg, job.tilt_y_deg, job.turn_deg)
    return job.kind == "capsule" and job.diameter > 0 and job.length > 0 and not any(placed)


def centred(points: Float[ndarray, "n 3"], stock: Stock, margin: float) -> Float[ndarray, "4 4"]:
    """The shift (4, 4) of the part's points across the Z axis after which the farthest point of the stock is
    nearest to them.

    At least `margin` mm of material stay round the part (as much as there is where that is less).
    """
    surface, tree = stock.mesh(CHORD).vertices, cKDTree(points)
    room = min(margin + SPARE, -float(stock.signed_distance(points).max()))

    def largest(x: ndarray) -> float:
        shift = np.append(x, 0.0)
        short = max(0.0, room + float(stock.signed_distance(points + shift).max()))
        return float(np.max(tree.query(surface - shift)[0])) + PENALTY * short

    start = SHIFT * np.vstack([np.zeros(2), np.eye(2)])
    found = minimize(
        largest, np.zeros(2), method="Nelder-Mead", options={"maxfev": TRIALS, "initial_simplex": start}
    )
    transform = np.eye(4)
    if found.fun < largest(np.zeros(2)):
        transform[:2, 3] = found.x
    return transform
