"""The pull at the feet of the farthest points of the stock, towards those points and all out: what is left
there decides K.

Without it all 39 cuts of a talus become 38, of which one is not certified, and the levels of 3distph take 1.16 times
as long.
"""

import numpy as np

from bonecam.arrays import unit
from bonecam.levels.problem.energies.energy import Given, Pulled
from bonecam.levels.problem.energies.pull import OVERSHOOT, targets
from bonecam.surface.query.closest_point import closest_points_near

FARTHEST = 1.0
"""Points of the stock pull at their closest points where they are less than this number of depths nearer than the
farthest one."""
MOST = 600
"""Points of the stock that pull at most."""
WEIGHT = 0.3
"""Their share of the weight of all pulls."""


def farthest(given: Given) -> Pulled:
    """The closest points are samples of their own, the farther the point the heavier."""
    before, rest = given.before, given.rest
    least = rest.farthest - FARTHEST * given.cut.depth
    candidates = np.flatnonzero(rest.at_most > least)
    candidates = candidates[:: 1 + len(candidates) // MOST]
    start = rest.feet[candidates]
    s, t, x, _ = closest_points_near(before, rest.points[candidates], start[:, 0], start[:, 1], 3)
    across = rest.points[candidates] - x
    distance = np.linalg.norm(across, axis=1)
    weights = np.clip((distance - least) / (rest.farthest - least), 0, 1)
    kept = weights > 0
    weights = WEIGHT * weights[kept] / weights.sum()
    s = s[kept]
    t = t[kept]
    x = x[kept]
    towards = unit(across[kept])
    target = targets(given, x, s=s, t=t, normals=towards, towards=towards, share=np.ones(len(s)))
    return Pulled(s, t, R=before.basis(s, t)[0], x=x, weights=weights, target=target, beyond=np.full(len(s), OVERSHOOT))
