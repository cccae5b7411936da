"""How far the stock is from a level: over points of the stock, the distance to the nearest sample's
neighbourhood.

No level lies behind the one before, so a point's distance only falls: of the points of the stock only those
are measured again that were farther from the level before than the farthest is from this one, until they are
known not to be from this one. At the part a point is not farther than a neighbour that is measured and the
way to it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import lengths
from bonecam.levels.problem.discretisation import Discretisation
from bonecam.levels.problem.samples import multiply
from bonecam.setup.stock import Stock
from bonecam.surface.query.closest_point import closest_points_near
from bonecam.surface.tspline import TSpline

CHORD = 0.01
"""Chord tolerance (mm) of the stock's mesh, whose points are measured from."""
FIRST = 200
"""So many points, the farthest from the level before, are measured first: their largest distance bounds the others."""
EVERY = 10
"""At the part, from which nothing was measured yet, one in so many points is measured first."""
STEPS = 4
"""Newton steps to a closest point on a level, from that on the level before or from the nearest sample."""


@dataclass(frozen=True, eq=False)
class Remaining:
    """Points of the stock, farthest first, for each a distance (mm) it is not farther than (the first one's
    is exact), and the parameters (s, t) of the foot at which that was found; and the watched point of the
    level that is `deepest` inside the stock, and how deep, mm: from the bottom of a hollow it is farther to
    the stock than from the stock to its sides."""

    points: Float[ndarray, "n 3"]
    at_most: Float[ndarray, " n"]
    feet: Float[ndarray, "n 2"]
    deepest: Float[ndarray, "3"]
    depth: float

    @property
    def farthest(self) -> float:
        """The largest distance of a point of the stock from the level, mm."""
        return float(self.at_most[0])

    @property
    def left(self) -> float:
        """The largest distance either way, mm."""
        return max(self.farthest, self.depth)

    @property
    def place(self) -> Float[ndarray, "3"]:
        """Where the distance left is largest."""
        return self.points[0] if self.farthest >= self.depth else self.deepest


def whole(stock: Stock) -> Remaining:
    """Points of the stock, from which nothing was measured yet."""
    mesh = stock.mesh(CHORD)
    points = stock.closest_points(np.vstack([mesh.vertices, mesh.vertices[mesh.faces].mean(1)]))
    return Remaining(points, np.full(len(points), np.inf), np.zeros((len(points), 2)), points[0], np.inf)


def remaining(discretisation: Discretisation, P: Float[ndarray, "c 3"], before: Remaining) -> Remaining:
    """What is left above the level with control points P, which encloses the one `before` was measured
    from."""
    known = np.isfinite(before.farthest)
    level = discretisation.surface.with_control_points(P)
    samples = discretisation.samples if known else discretisation.watch
    tree = cKDTree(multiply(samples.R, P))
    distance = before.at_most.copy()
    footpoints = before.feet.copy()

    def measure(which: ndarray) -> None:
        points = before.points[which]
        to_sample, nearest = tree.query(points)
        for start in (np.column_stack([samples.s, samples.t])[nearest], before.feet[which]):
            away, its = _nearest(level, points, start)
            nearer = away < distance[which]
            distance[which[nearer]], footpoints[which[nearer]] = away[nearer], its[nearer]
        distance[which] = np.minimum(to_sample, distance[which])

    every = np.arange(len(distance))
    first = every[:FIRST] if known else every[::EVERY]
    measure(first)
    if not known:
        apart, nearest = cKDTree(before.points[first]).query(before.points)
        distance = distance[first][nearest] + apart
        footpoints = footpoints[first][nearest]
    farthest = distance[first].max()
    others = np.flatnonzero(distance > farthest)
    distance[others], footpoints[others] = _nearest(level, before.points[others], footpoints[others], farthest)
    measure(others[distance[others] > farthest])
    order = np.argsort(-distance, kind="stable")
    own = multiply(discretisation.watch.R, P)
    depths = -discretisation.stock.signed_distance(own)
    deepest = int(np.argmax(depths))
    return Remaining(before.points[order], distance[order], footpoints[order], own[deepest], float(depths[deepest]))


def _nearest(level: TSpline, points: ndarray, start: ndarray, enough: float = 0.0) -> tuple[ndarray, ndarray]:
    """Distances of the feet found from these parameters, and their own; of places as near as `enough` where
    those are."""
    s, t, foot, _ = closest_points_near(
        level, points, s=start[:, 0], t=start[:, 1], steps=STEPS, near_enough=np.full(len(points), enough)
    )
    return lengths(points - foot), np.column_stack([s, t])
