"""Direct links: from the end of one pass to the near start of the next, just above the surface."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.orientation.axes.singularity import SINGULAR_ANGLE, avoid_singularity, least_polar_angles
from bonecam.orientation.collision.interpolation import interpolate_poses
from bonecam.orientation.links.link_space import LinkSpace
from bonecam.orientation.links.moves import Moves, moves_of
from bonecam.toolpath.path import Kind

LIFTS = (0.2, 0.5, 1.0)
"""Heights of a link above the contacts, along their normals, in the order they are tried, mm: it is to pass over what
still stands between them."""
LIFTED = np.arange(1, 8) / 8
"""Shares of a lift at which is looked whether it is in air."""
STEPS = 6
"""Straight moves of a link between its lifted ends."""
MAX_TURN = np.radians(30.0)
"""A link that would turn the axis by more is none, radians: opposite axes have no turn between them."""

Contacts = tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"], Float[ndarray, "k 3"]]
"""Ball centres, contact normals and tool axes."""


def direct_links(space: LinkSpace, ends: Contacts, starts: Contacts, max_length: float) -> list[Moves | None]:
    """The lowest link from each end to its start, both left out, that removes nothing; None where it is longer than
    `max_length` (mm), turns too far, passes the singularity, or is not proven free."""
    found: list[Moves | None] = [None] * len(ends[0])
    near = np.linalg.norm(starts[0] - ends[0], axis=1) <= max_length
    left = np.flatnonzero(near & (angles_between(ends[2], starts[2]) <= MAX_TURN))
    feed = min(space.feeds.link, space.checker.cutter.feed)
    for lift in LIFTS:
        if not len(left):
            break
        centres, axes, free = _links(space, ends, starts, left, lift)
        for k, c, v in zip(left[free], centres[free], axes[free], strict=True):
            found[k] = moves_of(Kind.LINK, c, v, feed)
        left = left[~free]
    return found


def _links(
    space: LinkSpace, ends: Contacts, starts: Contacts, which: Int[ndarray, " m"], lift: float
) -> tuple[Float[ndarray, "m p 3"], Float[ndarray, "m p 3"], Bool[ndarray, " m"]]:
    """Ball centres and axes of `which` of the links at one height, and whether each of them may be taken."""
    a, normals_a, axes_a = (each[which] for each in ends)
    b, normals_b, axes_b = (each[which] for each in starts)
    centres, axes = interpolate_poses(a + lift * normals_a, b + lift * normals_b, axes_a, axes_b, STEPS)
    axes = avoid_singularity(axes, centres, np.repeat(np.arange(len(a)), STEPS + 1))
    centres = centres.reshape(len(a), STEPS + 1, 3)
    axes = axes.reshape(len(a), STEPS + 1, 3)

    all_centres = np.concatenate([a[:, None], centres, b[:, None]], axis=1)
    all_axes = np.concatenate([axes_a[:, None], axes, axes_b[:, None]], axis=1)
    free = np.array([least_polar_angles(v).min() > SINGULAR_ANGLE for v in all_axes], dtype=bool)
    halfway = (centres[:, 1:] + centres[:, :-1]) / 2
    free[free] = space.in_air(np.concatenate([centres, halfway], axis=1)[free])
    for contacts, lifted in ((a, centres[:, 0]), (b, centres[:, -1])):
        rising = contacts[:, None] + LIFTED[:, None] * (lifted - contacts)[:, None]
        free[free] = space.left_in_air(contacts[free], rising[free])
    free[free] = _proven_free(space, all_centres[free], all_axes[free])
    return centres, axes, free


def _proven_free(
    space: LinkSpace, centres: Float[ndarray, "k p 3"], axes: Float[ndarray, "k p 3"]
) -> Bool[ndarray, " k"]:
    """Whether the straight moves through the p poses of each link are free of collision and gouge."""
    if not len(centres):
        return np.zeros(0, dtype=bool)
    count, poses = centres.shape[:2]
    flat_centres, flat_axes = centres.reshape(-1, 3), axes.reshape(-1, 3)
    joined = np.tile(np.r_[np.ones(poses - 1, dtype=bool), False], count)
    tips = flat_centres - space.ball_radius * flat_axes
    free = space.checker.moves_free(tips, flat_axes, joined, cutting=True)
    moves = np.flatnonzero(joined)
    free[moves] &= space.ball_free(flat_centres[moves], flat_centres[moves + 1])
    return np.asarray((free | ~joined).reshape(count, -1).all(axis=1))
