"""How a part lies best in a stock of given size: so that the largest distance from the stock to the part, and with it K_min, is least.

A few shifts along and small turns about the axes are searched (Nelder & Mead 1965, fixed start and steps: the same answer every time).
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import minimize
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from bonecam.job import StockJob
from bonecam.levels.stock import Stock

CHORD, STEPS, TILT, SHIFT, MOST_TILT = 0.1, 250, 0.02, 0.2, 0.15
PENALTY, SPARE = 10.0, 0.1


def is_free(job: StockJob) -> bool:
    """Whether the size of a capsule is given and how the part lies in it is not."""
    placed = (job.offset_x, job.offset_y, job.offset_z, job.tilt_x_deg, job.tilt_y_deg, job.turn_deg)
    return job.kind == "capsule" and job.diameter > 0 and job.length > 0 and not any(placed)


def centred(points: Float[ndarray, "n 3"], stock: Stock, margin: float) -> Float[ndarray, "4 4"]:
    """The rigid motion (4, 4) of the part's points after which the farthest point of the stock is nearest to them.

    At least `margin` mm of material stay round the part (as much as there is where that is less).
    """
    middle = points.mean(0)
    surface, tree = stock.mesh(CHORD).vertices, cKDTree(points)
    room = min(margin + SPARE, -float(stock.signed_distance(points).max()))

    def motion(x: ndarray) -> tuple[ndarray, ndarray]:
        turn = Rotation.from_rotvec([TILT * x[3], TILT * x[4], 0.0]).as_matrix()
        return turn, middle - turn @ middle + SHIFT * x[:3]

    def largest(x: ndarray) -> float:
        turn, shift = motion(x)
        distance = float(np.max(tree.query((surface - shift) @ turn)[0]))
        short = max(0.0, room + float(stock.signed_distance(points @ turn.T + shift).max()))
        return distance + PENALTY * (short + max(0.0, float(TILT * np.hypot(x[3], x[4])) - MOST_TILT))

    start = np.vstack([np.zeros(5), np.eye(5)])
    found = minimize(largest, np.zeros(5), method="Nelder-Mead", options={"maxfev": STEPS, "initial_simplex": start})
    transform = np.eye(4)
    if found.fun < largest(np.zeros(5)):
        transform[:3, :3], transform[:3, 3] = motion(found.x)
    return transform
