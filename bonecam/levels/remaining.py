"""How far the stock is from a level: over points of the stock, the distance to the nearest watched sample's neighbourhood.

No level lies behind the one before, so a point's distance only falls: of the points of the stock only those are measured again
that were farther from the level before than the farthest is from this one.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.levels.limits import feet
from bonecam.levels.setting import Setting
from bonecam.levels.stock import Stock

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
    level, watch, samples = setting.surface.with_control_points(P), setting.watch, setting.watch.R @ P
    tree, distance, places = cKDTree(samples), before.at_most.copy(), before.feet.copy()
    first = 0
    for stop in (min(FIRST, len(distance)), len(distance)):
        if first:
            stop = max(first, int(np.searchsorted(-before.at_most, -distance[:first].max())))
        points = before.points[first:stop]
        if len(points):
            to_sample, nearest = tree.query(points)
            s, t, foot, _ = feet(level, points, watch.s[nearest], watch.t[nearest], STEPS)
            places[first:stop] = np.column_stack([s, t])
            distance[first:stop] = np.minimum(to_sample, np.linalg.norm(points - foot, axis=1))
        first = stop
    order = np.argsort(-distance, kind="stable")
    return Remaining(before.points[order], distance[order], places[order])
