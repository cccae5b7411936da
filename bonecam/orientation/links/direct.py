"""Direct links: from the end of one pass to the near start of the next, just above the surface."""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.orientation.axes.singularity import SINGULAR_ANGLE, avoid_singularity, least_polar_angles
from bonecam.orientation.collision.interpolation import interpolate_poses
from bonecam.orientation.links.link_space import LinkSpace
from bonecam.orientation.links.moves import Moves, moves_of
from bonecam.toolpath.path import Kind

LIFT = 0.2
"""Height of the link above the contacts, along their normals, mm."""
STEPS = 6
"""Straight moves of a link between its lifted ends."""
MAX_TURN = np.radians(30.0)
"""A link that would turn the axis by more is none, radians: opposite axes have no turn between them."""

Contacts = tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"], Float[ndarray, "k 3"]]
"""Ball centres, contact normals and tool axes."""


def direct_links(space: LinkSpace, ends: Contacts, starts: Contacts, max_length: float) -> list[Moves | None]:
    """The link from each end to its start, both left out; None where it is longer than `max_length` (mm),
    turns too far, passes the singularity, or is not proven free."""
    a, normals_a, axes_a = ends
    b, normals_b, axes_b = starts
    turns_far = angles_between(axes_a, axes_b) > MAX_TURN
    target_axes = np.where(turns_far[:, None], axes_a, axes_b)
    centres, axes = interpolate_poses(a + LIFT * normals_a, b + LIFT * normals_b, axes_a, target_axes, STEPS)
    axes = avoid_singularity(axes, centres, np.repeat(np.arange(len(a)), STEPS + 1))
    centres = centres.reshape(len(a), STEPS + 1, 3)
    axes = axes.reshape(len(a), STEPS + 1, 3)

    all_centres = np.concatenate([a[:, None], centres, b[:, None]], axis=1)
    all_axes = np.concatenate([axes_a[:, None], axes, axes_b[:, None]], axis=1)
    possible = (np.linalg.norm(b - a, axis=1) <= max_length) & ~turns_far
    possible &= np.array([least_polar_angles(v).min() > SINGULAR_ANGLE for v in all_axes], dtype=bool)
    free = possible.copy()
    free[possible] = _proven_free(space, all_centres[possible], all_axes[possible])

    feed = min(space.feeds.link, space.checker.cutter.feed)
    return [moves_of(Kind.LINK, c, v, feed) if ok else None for c, v, ok in zip(centres, axes, free)]


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
