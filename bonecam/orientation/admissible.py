"""Axes that are allowed and free: where the wished-for axis collides, the nearest free direction of a fixed
fan takes its place.

The fan is an icosphere: the same directions for every contact, so that neighbours choose alike; a smoothing
of the choice along the passes follows, each step of it proven again. (The cones of Xu et al. 2013 will take
this file's place.)
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.orientation.limits import AxisLimits, angles_between, polar, unit, with_polar
from bonecam.orientation.pole import CONE

SUBDIVISIONS = 3
WAVE, MOST = 8, 120
CHUNK = 4000
SMOOTHING_ROUNDS, NEIGHBOURHOOD = 10, 12
SMOOTH_TURN = np.radians(1.5)

Free = Callable[[Int[ndarray, " k"], Float[ndarray, "k 3"]], Bool[ndarray, " k"]]
"""Whether contacts (by index) are free with the given axes."""


def fan() -> Float[ndarray, "647 3"]:
    """The vertices of an icosahedron, its triangles halved three times: 8 degrees apart; six round the pole
    in its place."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [(0, a, b * golden) for a in (-1, 1) for b in (-1, 1)]
    points = unit(np.array([np.roll(c, k) for k in range(3) for c in corners], dtype=np.float64))
    edge = 1.2
    for _ in range(SUBDIVISIONS):
        i, j = np.triu_indices(len(points), 1)
        near = np.linalg.norm(points[i] - points[j], axis=1) < edge
        points = np.vstack([points, unit(points[i[near]] + points[j[near]])])
        edge /= 1.9
    azimuth = np.arange(6) * np.pi / 3
    ring = with_polar(np.column_stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth]), np.full(6, CONE))
    return np.vstack([points[polar(points) >= CONE], ring])


def allowed(
    axes: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], limits: AxisLimits, max_tilt: float
) -> Bool[ndarray, " n"]:
    """Within the machine's limits and no further than `max_tilt` from the normal."""
    return limits.allow(axes) & (dots(axes, normals) >= np.cos(max_tilt) - 1e-9)


def nearest_free(
    which: Int[ndarray, " k"],
    wished: Float[ndarray, "k 3"],
    normals: Float[ndarray, "k 3"],
    limits: AxisLimits,
    max_tilt: float,
    free: Free,
) -> tuple[Float[ndarray, "k 3"], list[str]]:
    """The free direction of the fan nearest to each wish, and for each an empty string, `limits` or
    `collision`."""
    directions = fan()
    directions = directions[limits.allow(directions)]
    found, reasons = wished.copy(), [""] * len(which)
    for start in range(0, len(which), CHUNK):
        here = np.arange(start, min(start + CHUNK, len(which)))
        steep = normals[here] @ directions.T < np.cos(max_tilt)
        order = np.argsort(np.where(steep, 9.0, -wished[here] @ directions.T), axis=1, kind="stable")[
            :, :MOST
        ]
        usable = ~np.take_along_axis(steep, order, axis=1)
        for i in here[~usable.any(axis=1)]:
            reasons[i] = "limits"
        left = np.flatnonzero(usable.any(axis=1))
        for wave in range(0, order.shape[1], WAVE):
            left = _try_wave(
                left,
                here,
                which,
                directions,
                order[:, wave : wave + WAVE],
                usable[:, wave : wave + WAVE],
                free,
                found,
            )
            if not len(left):
                break
        for i in here[left]:
            reasons[i] = "collision"
    return found, reasons


def _try_wave(
    left: ndarray,
    here: ndarray,
    which: ndarray,
    directions: ndarray,
    order: ndarray,
    usable: ndarray,
    free: Free,
    found: ndarray,
) -> ndarray:
    """Test the next few candidates of those still without an axis; answer who is left."""
    row, column = np.nonzero(usable[left])
    good = np.zeros((len(left), order.shape[1]), dtype=bool)
    if len(row):
        good[row, column] = free(which[here[left[row]]], directions[order[left[row], column]])
    lucky = good.any(axis=1)
    best = order[left[lucky], good[lucky].argmax(axis=1)]
    found[here[left[lucky]]] = directions[best]
    return left[~lucky]


def smoothed(
    axes: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    passes: Int[ndarray, " n"],
    changed: Bool[ndarray, " n"],
    limits: AxisLimits,
    max_tilt: float,
    free: Free,
) -> Float[ndarray, "n 3"]:
    """The axes averaged along the passes near what was `changed`; every new axis is allowed and free, or the
    old one stays."""
    axes = axes.copy()
    if not changed.any():
        return axes
    same = np.r_[passes[1:] == passes[:-1], False]
    close = np.convolve(changed.astype(float), np.ones(2 * NEIGHBOURHOOD + 1), mode="same")[: len(axes)] > 0.5
    for _ in range(SMOOTHING_ROUNDS):
        mean = 2 * axes
        mean[:-1] += np.where(same[:-1, None], axes[1:], axes[:-1])
        mean[-1] += axes[-1]
        mean[1:] += np.where(same[:-1, None], axes[:-1], axes[1:])
        mean[0] += axes[0]
        mean = unit(mean)
        which = np.flatnonzero(
            close & (angles_between(mean, axes) > SMOOTH_TURN / 4) & allowed(mean, normals, limits, max_tilt)
        )
        if not len(which):
            break
        which = which[free(which, mean[which])]
        axes[which] = mean[which]
    return axes
