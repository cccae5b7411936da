"""A mesh laid on the stock: its vertices on the surface, those next to an edge on the edge.

Nearest points alone would cut the edges off by what the mesh lies below them: material that stays there, because no
tool reaches it, would not be known.
"""

import numpy as np
from jaxtyping import Bool, Float, Int32
from numpy import ndarray

from bonecam.setup.stock import Stock

SHARP = np.radians(40.0)
"""Neighbours whose normals are farther apart, and as far from opposite, have an edge between them: on round walls of
1 mm radius they are 36 degrees apart, 0.6 mm."""
PARALLEL = 0.1
"""Three walls whose planes have a smaller share of a singular value have no corner, but an edge."""


def places_on_stock(
    stock: Stock, points: Float[ndarray, "n 3"], faces: Int32[ndarray, "f 3"]
) -> Float[ndarray, "n 3"]:
    """The place of the stock's surface for each vertex of a closed mesh in it: the nearest one, but for the nearer of
    two neighbours on both sides of an edge a place on that edge, and where three walls meet their corner."""
    nearest, normals = stock.closest_points(points), stock.normals(points)
    sides = faces, faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]
    sharp = np.array([_sharp(normals[side[:, 0]], normals[side[:, 1]]) for side in sides])
    pairs = np.vstack([side[across, :2] for side, across in zip(sides, sharp, strict=True)])

    stock_points = nearest
    for neighbours in (pairs, faces[sharp.all(axis=0)]):
        meeting = stock.closest_points(_meeting(nearest[neighbours], normals[neighbours]))

        # The places, that of the neighbours in each row which is nearest to its target moved there
        away = np.linalg.norm(stock_points[neighbours] - meeting[:, None], axis=2)
        moved = stock_points.copy()
        moved[neighbours[np.arange(len(away)), np.argmin(away, axis=1)]] = meeting
        stock_points = moved
    return stock_points


def _sharp(u: Float[ndarray, "n 3"], v: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Whether an edge is between neighbours with these normals."""
    return np.abs((u * v).sum(axis=1)) < np.cos(SHARP)


def _meeting(points: Float[ndarray, "m k 3"], normals: Float[ndarray, "m k 3"]) -> Float[ndarray, "m 3"]:
    """Where the planes through k points with these normals meet, nearest to the middle of the points."""
    middle = points.mean(axis=1)
    out = (normals * (points - middle[:, None])).sum(axis=2)
    return middle + (np.linalg.pinv(normals, rcond=PARALLEL) @ out[:, :, None])[:, :, 0]
