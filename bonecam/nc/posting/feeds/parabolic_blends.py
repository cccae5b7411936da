"""The time of moves that a control blends as LinuxCNC does where rotary axes turn: by parabolas, two moves at a time.

Each move speeds up from rest and slows down to rest, by half of what its axes can; the next one sets out while it slows
down. With the way 1 of a move and its acceleration a (half of the least bound of its axes over their shares of the
way), its speed is at most v = min(1 / time at its feed, sqrt(a)), and the next one sets out after

    1 / v + max(v - b, 0) / a,    b = 2 sqrt(a P / (L cos(h))),

b being the speed below which the corner stays within the tolerance P (mm): L is the length of X, Y, Z in the move, 2 h
the angle between it, backwards, and the next one (LinuxCNC 2.9, `emc/tp/tp.c`: tpComputeBlendVelocity;
`tc.c`: tcGetOverallMaxAccel). Moves are not looked ahead over, so that short ones never reach their feed.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, largest, lengths, unit


def blended_minutes(
    joints: Float[ndarray, "n 5"], at_feed: Float[ndarray, "m"], most: Float[ndarray, "5"], tolerance: float
) -> Float[ndarray, "m"]:
    """Minutes of the moves between successive joints (mm, rad), until the next one sets out; `at_feed` are those
    without accelerations, `most` the accelerations of the axes (mm, rad and minutes)."""
    steps = np.diff(joints, axis=0)
    heading = unit(steps[:, :3])
    ramps = largest(np.abs(steps) / most)
    a = 0.5 / np.where(ramps > 0, ramps, 1.0)
    with np.errstate(divide="ignore"):
        speed = np.minimum(1 / at_feed, np.sqrt(a))
        cosine = np.sqrt(np.maximum(1 - dots(heading[:-1], heading[1:]), 0.0) / 2)
        blend = 2 * np.sqrt(a[:-1] * tolerance / (lengths(steps[:-1, :3]) * cosine))
    waits = np.maximum(speed - np.r_[blend, 0.0], 0.0) / a
    return np.where(ramps > 0, 1 / speed + waits, at_feed)
