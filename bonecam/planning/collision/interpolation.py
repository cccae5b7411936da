"""Poses between two poses: tips on the straight line, axes on the great circle at even angles."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, numbered, unit

SMALL_ANGLE = 1e-9
"""Below this angle (radians) the great circle is taken as straight: sin x = x to rounding."""


def interpolate_poses(
    first: Float[ndarray, "m 3"],
    last: Float[ndarray, "m 3"],
    first_axes: Float[ndarray, "m 3"],
    last_axes: Float[ndarray, "m 3"],
    steps: int | Int[ndarray, " m"],
) -> tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"]]:
    """Points and axes of steps + 1 poses of each move, both ends included, one move behind the other.

    The axis at fraction f is (sin((1 - f) a) v0 + sin(f a) v1) / sin(a), a being the angle between the ends
    (spherical linear interpolation, Shoemake 1985).
    """
    counts = np.broadcast_to(np.asarray(steps) + 1, len(first))
    move, place = numbered(counts)
    f = (place / (counts[move] - 1))[:, None]

    angle = angles_between(first_axes, last_axes)[move][:, None]
    bent = angle >= SMALL_ANGLE
    sine = np.where(bent, np.sin(angle), 1.0)
    a = np.where(bent, np.sin((1 - f) * angle) / sine, 1 - f)
    b = np.where(bent, np.sin(f * angle) / sine, f)
    points = (1 - f) * first[move] + f * last[move]
    return points, unit(a * first_axes[move] + b * last_axes[move])
