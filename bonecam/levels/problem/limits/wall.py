"""The stock's wall: no sample leaves the stock. Its surface is as good as the plane that touches it nearest
to the sample."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.levels.problem.cut import Cut
from bonecam.setup.stock import Stock


def wall(
    cut: Cut, gap: Float[ndarray, " k"], stock: Stock, y: Float[ndarray, "k 3"]
) -> tuple[Float[ndarray, "k 3"], Float[ndarray, " k"]]:
    """Planes m . y <= h at samples that are at y now and `gap` inside the stock at the level before: what is
    near may stay."""
    distance, m = stock.distances_and_normals(y)
    return m, dots(m, y) - distance - np.minimum(gap, cut.clearance)


def inside(stock: Stock, points: Float[ndarray, "k 3"], clearance: Float[ndarray, " k"]) -> Float[ndarray, "k 3"]:
    """The points, those less than their clearance inside the stock taken there along the shortest way."""
    distance, out = stock.distances_and_normals(points)
    return points - np.maximum(distance + clearance, 0)[:, None] * out
