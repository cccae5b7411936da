"""The depth of a cut the other way: no place of the level before may be farther from the new level than the
cut is deep.

In a hollow what is above a place is near to the hollow's sides, and so not too deep, when the place itself is
too far behind already.

Where the place at (s, t) slid to the foot (s + ds, t + dt), the foot of the one it came from is near (s - ds,
t - dt): most are near enough there, and only the others' feet are sought.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.surface.query.closest_point import closest_points_near
from bonecam.surface.tspline import TSpline


@dataclass(frozen=True, eq=False)
class ReverseDepths:
    """Places of the level before (`which` of those asked for), the parameters (s, t) of their feet on the new
    level, the feet, how far these are `away`, mm, and the directions there."""

    which: Int[ndarray, " k"]
    s: Float[ndarray, " k"]
    t: Float[ndarray, " k"]
    foot: Float[ndarray, "k 3"]
    away: Float[ndarray, " k"]
    n: Float[ndarray, "k 3"]


def reverse_depths(
    after: TSpline,
    x: Float[ndarray, "n 3"],
    y: Float[ndarray, "n 3"],
    s: Float[ndarray, " n"],
    t: Float[ndarray, " n"],
    foot_s: Float[ndarray, " n"],
    foot_t: Float[ndarray, " n"],
    far: Float[ndarray, " n"],
    steps: int,
) -> ReverseDepths:
    """The places of the level before that are farther than `far` (mm) from the new level.

    A place with parameters (s, t) lies at x on the level before and at y on the new one; (foot_s, foot_t) are
    the parameters of the closest point to y on the level before.
    """
    which = np.flatnonzero(lengths(y - x) > far)
    _, _, foot, _ = closest_points_near(after, x[which], (2 * s - foot_s)[which], (2 * t - foot_t)[which], 0)
    which = which[lengths(foot - x[which]) > far[which]]
    s, t, foot, _ = closest_points_near(after, x[which], s=s[which], t=t[which], steps=steps, near_enough=far[which])
    across = foot - x[which]
    away = lengths(across)
    kept = away > far[which]
    n = across[kept] / away[kept, None]
    return ReverseDepths(which=which[kept], s=s[kept], t=t[kept], foot=foot[kept], away=away[kept], n=n)
