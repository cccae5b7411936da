"""Whether the stock holds the part with a margin, and what to change where it does not."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import ROUNDING
from bonecam.errors import StockError, place_name
from bonecam.setup.stock import Stock

MARGIN = 0.05
"""Least material that the stock must have outside the part, mm: half the default finishing depth."""


def require_inside(
    stock: Stock, points: Float[ndarray, "n 3"], margin: float, otherwise: str = "", spare: float = 0.0
) -> None:
    """Raise StockError where a point has less than `margin` mm of the stock's material outside it.

    The remedy asks for `spare` mm more, by which a surface that is fitted to the points may leave them; `otherwise` is
    added to it. Evidence: `distance` (signed, mm) and `place` of the worst point.
    """
    distance = stock.signed_distance(points)
    worst = int(np.argmax(distance))
    if distance[worst] <= -margin + ROUNDING:
        return
    if distance[worst] > 0:
        trouble = f"leaves it by {distance[worst]:.3f} mm"
    else:
        trouble = f"comes within {abs(distance[worst]):.3f} mm of its wall"
    where = place_in(stock, points[worst])
    remedy = stock.larger(points[distance > -margin - spare], float(distance[worst]) + margin + spare)
    raise StockError(
        f"the stock ({stock}) does not hold the part, which {trouble} at {where}: {remedy}{otherwise}",
        distance=float(distance[worst]),
        place=points[worst],
    )


def place_in(stock: Stock, place: Float[ndarray, "3"]) -> str:
    """A place (mm) as messages name it, with the stock's heights in the same frame."""
    low, high = stock.bounds[:, 2]
    return f"{place_name(place)} (the stock reaches from z = {low:.2f} to {high:.2f})"
