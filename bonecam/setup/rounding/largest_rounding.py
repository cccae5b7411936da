"""The largest radius by which the edges of a stock can be rounded and still hold the part."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import ROUNDING
from bonecam.errors import StockError
from bonecam.setup.containment import place_in
from bonecam.setup.rounding.rounded_stock import ALL
from bonecam.setup.stock import Stock

LEAST = 0.1
"""Smallest radius that is tried, in inradii of the stock: less leaves edges that a morph cannot follow."""
HALVINGS = 20
"""Bisections of the radius: to a millionth of the inradius."""
ROOM = 0.25
"""Material, mm, left over the part for the levels that pass between it and the stock's wall: in less, waves of
one level break the next."""


def round_most(stock: Stock, points: Float[ndarray, "n 3"], margin: float) -> Stock | None:
    """The stock rounded by the largest radius that leaves `margin` mm over every point; None where LEAST of
    its inradius does not.

    ROOM mm, or half of what the stock itself has over a point, is left where some radius does that.
    """
    inradius = stock.inradius
    room = np.clip(-stock.signed_distance(points) / 2, margin, max(margin, ROOM))

    def holds(radius: float) -> bool:
        return bool((stock.round_edges(radius).signed_distance(points) + room).max() <= ROUNDING)

    low = LEAST * inradius
    high = ALL * inradius
    if holds(high):
        return stock.round_edges(high)
    if not holds(low):
        room[:] = margin
        if not holds(low):
            return None
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return stock.round_edges(low)


def require_roundable(stock: Stock, points: Float[ndarray, "n 3"], margin: float, otherwise: str = "") -> Stock:
    """The stock with its edges rounded as far as the part allows; a stock without edges itself.

    StockError with the place where the part comes too near to an edge for any radius; `otherwise` is added to
    its remedy.
    """
    if not stock.has_edges:
        return stock
    rounded = round_most(stock, points, margin)
    if rounded is None:
        least = stock.round_edges(LEAST * stock.inradius)
        worst = points[np.argmax(least.signed_distance(points))]
        raise StockError(
            f"the part comes too near to the edges of the stock ({stock}) at {place_in(stock, worst)} "
            f"to round them: give a larger stock or a capsule{otherwise}",
            distance=float(stock.signed_distance(worst[None])[0]),
            place=worst,
        )
    return rounded
