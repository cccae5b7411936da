"""How far the stock is from a level: over points of the stock, the distance to the nearest sample's neighbourhood.

No level lies behind the one before, so a point's distance only falls: of the points of the stock only those are measured again
that were farther from the level before than the farthest is from this one.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import lengths
from bonecam.levels.limits import feet
from bonecam.levels.setting import Setting
from bonecam.levels.stock import Stock
from bonecam.surface.tspline import TSpline

CHORD, FIRST, STEPS = 0.01, 500, 4


@dataclass(frozen=True, eq=False)
class Remaining:
    """Points of the stock, farthest first, for each a distance (mm) it is not farther than (the first one's is exact), and the
    parameters (s, t) of the foot at which that was found."""

    points: Float[ndarray, "n 3"]
    at_most: Float[ndarray, " n"]
    feet: Float[ndarray, "n 2"]

    @property
    def left(self) -> float:
        """The largest distance, mm."""
        return float(self.at_most[0])

    @property
    def place(self) -> Float[ndarray, "3"]:
        """Where it is."""
        return self.points[0]


def whole(stock: Stock) -> Remaining:
    """Nothing measured yet."""
    mesh = stock.mesh(CHORD)
    points = stock.nearest(np.vstack([mesh.vertices, mesh.vertices[mesh.faces].mean(1)]))
    return Remaining(points, np.full(len(points), np.inf), np.zeros((len(points), 2)))


def remaining(setting: Setting, P: Float[ndarray, "c 3"], before: Remaining) -> Remaining:
    """What is left above the level with control points P, which encloses the one `before` was measured from."""
    known = np.isfinite(before.left)
    level, samples = setting.surface.with_control_points(P), setting.samples if known else setting.watch
    tree, distance, places = cKDTree(samples.R @ P), before.at_most.copy(), before.feet.copy()
    first = 0
    for stop in (min(FIRST, len(distance)), len(distance)):
        if first:
            stop = max(first, int(np.searchsorted(-before.at_most, -distance[:first].max())))
        points = before.points[first:stop]
        if len(points):
            to_sample, nearest = tree.query(points)
            distance[first:stop], places[first:stop] = _nearest(level, points, np.column_stack([samples.s, samples.t])[nearest])
            if known:
                again, its = _nearest(level, points, before.feet[first:stop])
                nearer = again < distance[first:stop]
                distance[first:stop][nearer], places[first:stop][nearer] = again[nearer], its[nearer]
            distance[first:stop] = np.minimum(to_sample, distance[first:stop])
        first = stop
    order = np.argsort(-distance, kind="stable")
    return Remaining(before.points[order], distance[order], places[order])


def _nearest(level: TSpline, points: ndarray, start: ndarray) -> tuple[ndarray, ndarray]:
    """Distances of the feet found from these parameters, and their own."""
    s, t, foot, _ = feet(level, points, start[:, 0], start[:, 1], STEPS)
    return lengths(points - foot), np.column_stack([s, t])
