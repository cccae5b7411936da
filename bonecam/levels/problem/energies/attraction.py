"""Where each point of a level is pulled: unit directions, along which the attracting points H of the energy
lie.

`stock`   between the level's own normal and the shortest way to the stock: the nearer to the stock (within
BLEND mm), the more
          of the latter. Normals alone meet in hollows; the shortest ways of a convex stock never do.
`sphere`  as published (Gan et al. 2014): radially from the middle of the stock to its bounding sphere. Drags
the points
          along the axis and needs more levels.
`nearest` the shortest way to the stock from the start.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.setup.stock import Stock

BLEND = 4.0
"""Distance (mm) from the stock from which on the shortest way to it counts, as much as the normal where it is
reached."""

Attraction = Callable[[ndarray, ndarray, Stock], ndarray]


def towards_stock(points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], stock: Stock) -> Float[ndarray, "n 3"]:
    """The level's normals, half way to the shortest way to the stock where they are at it."""
    distance, out = stock.distances_and_normals(points)
    return unit(normals + np.clip(1 + distance / BLEND, 0, 1)[:, None] * out)


def towards_nearest(
    points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], stock: Stock
) -> Float[ndarray, "n 3"]:
    """The shortest way to the stock."""
    return stock.normals(points)


def towards_sphere(
    points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], stock: Stock
) -> Float[ndarray, "n 3"]:
    """Away from the middle of the stock, where the published bounding sphere has its centre."""
    return unit(points - stock.middle)


ATTRACTIONS: dict[str, Attraction] = {"stock": towards_stock, "sphere": towards_sphere, "nearest": towards_nearest}
