"""Admissible tool axes: within the machine's limits, near enough to the contact normal, and free of
collision.

Where the preferred axis is not admissible, the nearest admissible direction of a fixed set takes its place.
The set is an icosphere, the same for every contact, so that neighbours choose alike; the axes are then
smoothed along the passes, and each step of that is proven free again.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, dots, frozen, unit
from bonecam.machine.limits import MachineLimits, polar_angles, with_polar_angles
from bonecam.planning.axes.singularity import SINGULAR_CONE

SUBDIVISIONS = 3
"""Times that the edges of the icosahedron are halved: its directions are then about 8 degrees apart."""
BATCH = 8
"""Directions that are tested for a contact at once."""
MAX_DIRECTIONS = 120
"""Directions that are tested for a contact at most: the nearest ones."""
CHUNK = 4000
"""Contacts whose directions are sorted at once: it bounds the memory."""
SMOOTHING_ROUNDS = 10
"""Times that axes are averaged with their neighbours at most."""
NEIGHBOURHOOD = 12
"""Contacts before and behind a replaced axis whose axes are smoothed too."""
MIN_TURN = np.radians(0.375)
"""Smoothing leaves an axis alone that it would turn by less, radians."""
FEWEST = 100
"""A machine with fewer candidate directions within its limits has others: a narrow band, or a curve."""
AROUND = 180
"""Directions on each ring of a narrow band."""
MOST_SAMPLES = 720
"""Directions about of those that a machine reaches."""
COSINE_ROUNDING = 1e-9
"""Cosines this little below a limit are on it."""
COLLISION, LIMITS = -1, -2
"""Why a contact has no direction, in the place of the direction's index."""

Free = Callable[[Int[ndarray, " k"], Float[ndarray, "k 3"]], Bool[ndarray, " k"]]
"""Whether the tool on contacts (by index) is free of collision with the given axes."""


def candidate_directions() -> Float[ndarray, "647 3"]:
    """The vertices of an icosphere, about 8 degrees apart; six directions on the singular cone stand for
    those inside it."""
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
    horizontal = np.column_stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth])
    ring = with_polar_angles(horizontal, np.full(6, SINGULAR_CONE))
    return np.vstack([points[polar_angles(points) >= SINGULAR_CONE], ring])


@lru_cache(maxsize=8)
def directions_within(limits: MachineLimits) -> Float[ndarray, "d 3"]:
    """The candidate directions of a machine, read-only: all of the icosphere, or where few of these are within its
    limits, directions that are."""
    directions = candidate_directions()
    if limits.allow(directions).sum() < FEWEST:
        if limits.reached is not None:
            directions = limits.reached.samples
            stride = max(len(directions) // MOST_SAMPLES, 1)
            directions = directions[::stride]
        elif limits.largest > SINGULAR_CONE:
            # Directions on rings of polar angles within a narrow band, radians
            smallest = max(limits.smallest, SINGULAR_CONE)
            azimuth = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
            around = np.column_stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth])
            angles = [smallest]
            if smallest != limits.largest:
                angles += [(smallest + limits.largest) / 2, limits.largest]
            directions = np.vstack([with_polar_angles(around, np.full(AROUND, angle)) for angle in angles])
    return frozen(directions)


def within_limits(
    axes: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], limits: MachineLimits, max_tilt: float
) -> Bool[ndarray, " n"]:
    """Within the machine's limits, and no further than `max_tilt` (radians) from the contact normal."""
    return limits.allow(axes) & (dots(axes, normals) >= np.cos(max_tilt) - COSINE_ROUNDING)


def nearest_free_axes(
    contacts: Int[ndarray, " k"],
    preferred: Float[ndarray, "k 3"],
    normals: Float[ndarray, "k 3"],
    limits: MachineLimits,
    max_tilt: float,
    free: Free,
) -> tuple[Float[ndarray, "k 3"], list[str]]:
    """The free candidate direction nearest to each preferred axis, and an empty string for each; where there
    is none the preferred axis, and why: `limits` or `collision`."""
    directions = directions_within(limits)
    directions = directions[limits.allow(directions)]
    starts = range(0, len(contacts), CHUNK)
    chunks = [slice(start, start + CHUNK) for start in starts]
    chosen = [
        _nearest_free(
            contacts[c], preferred[c], normals=normals[c], directions=directions, max_tilt=max_tilt, free=free
        )
        for c in chunks
    ]
    index = np.concatenate([np.zeros(0, dtype=np.int64), *chosen])
    axes = preferred.copy()
    axes[index >= 0] = directions[index[index >= 0]]
    reasons = np.select([index == LIMITS, index == COLLISION], ["limits", "collision"], "")
    return axes, reasons.tolist()


def _nearest_free(
    contacts: Int[ndarray, " k"],
    preferred: Float[ndarray, "k 3"],
    normals: Float[ndarray, "k 3"],
    directions: Float[ndarray, "d 3"],
    max_tilt: float,
    free: Free,
) -> Int[ndarray, " k"]:
    """Index of the free direction nearest to each preferred axis, or COLLISION or LIMITS."""
    too_far = normals @ directions.T < np.cos(max_tilt)
    behind_all = 9.0
    order = np.argsort(np.where(too_far, behind_all, -preferred @ directions.T), axis=1, kind="stable")
    order = order[:, :MAX_DIRECTIONS]
    usable = ~np.take_along_axis(too_far, order, axis=1)

    chosen = np.where(usable.any(axis=1), COLLISION, LIMITS)
    left = np.flatnonzero(usable.any(axis=1))
    for start in range(0, order.shape[1], BATCH):
        batch = order[left, start : start + BATCH]
        good = usable[left, start : start + BATCH]
        row, column = np.nonzero(good)
        if len(row):
            good[row, column] = free(contacts[left[row]], directions[batch[row, column]])
        has_free = good.any(axis=1)
        chosen[left[has_free]] = batch[has_free, good[has_free].argmax(axis=1)]
        left = left[~has_free]
        if not len(left):
            break
    return chosen


def smooth_axes(
    axes: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    passes: Int[ndarray, " n"],
    replaced: Bool[ndarray, " n"],
    limits: MachineLimits,
    max_tilt: float,
    free: Free,
) -> Float[ndarray, "n 3"]:
    """The axes averaged along the passes near those that were `replaced`; an average that is not within the
    limits and free leaves the axis as it was."""
    axes = axes.copy()
    if not replaced.any():
        return axes
    same_pass = np.r_[passes[1:] == passes[:-1], False]
    window = np.ones(2 * NEIGHBOURHOOD + 1)
    close = np.convolve(replaced.astype(float), window, mode="same")[: len(axes)] > 0.5
    for _ in range(SMOOTHING_ROUNDS):
        # (1 2 1) / 4 of each axis and its neighbours on the pass, unit; the axis stands for a missing neighbour
        joined = same_pass[:-1, None]
        mean = 2 * axes
        mean[:-1] += np.where(joined, axes[1:], axes[:-1])
        mean[-1] += axes[-1]
        mean[1:] += np.where(joined, axes[:-1], axes[1:])
        mean[0] += axes[0]
        mean = unit(mean)

        if limits.narrow:
            mean = limits.nearest(mean)
        turned = angles_between(mean, axes) > MIN_TURN
        which = np.flatnonzero(close & turned & within_limits(mean, normals, limits, max_tilt))
        if not len(which):
            break
        which = which[free(which, mean[which])]
        axes[which] = mean[which]
    return axes
