"""Direct links: from the end of one pass to the near start of the next, just above what stands between them.

A short link runs straight, as low as it can. A longer one runs over the material like a taut string: the straight line
is raised along the normals, which turn from the one end's to the other's, until the ball is off the material, and then
to the concave envelope of these heights.
"""

from collections.abc import Sequence
from itertools import combinations, product

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.planning.axes.singularity import SINGULAR_ANGLE, avoid_singularity, least_polar_angles
from bonecam.planning.collision.interpolation import interpolate_poses
from bonecam.planning.links.link_space import LinkSpace
from bonecam.planning.links.moves import LinkMoves, moves_of
from bonecam.tool.path import MoveKind

LIFTS = (0.2, 0.5, 1.0)
"""Heights of a straight link above the contacts, along their normals or else their axes, in the order they are tried,
mm: it is to pass over what still stands between them. By the post a normal may lead into the fillet round it."""
LIFTED = np.arange(1, 8) / 8
"""Shares of a lift at which is looked whether it is in air."""
STEPS = 6
"""Straight moves of a straight link between its lifted ends."""
MAX_TURN = np.radians(30.0)
"""A straight link that would turn the axis by more is none, radians."""

ABOVE = 0.3
"""Longer links run so far above the mesh of the material, mm: more than twice what it may lie below the material."""
LONG_STEPS = 20
"""Straight moves of a longer link."""
LONG = 20.0
"""No link is longer, mm: 0.8 s at 1500 mm/min, which is what a retract takes."""
MAX_LONG_TURN = np.radians(150.0)
"""A longer link that would turn axis or normal by more is none, radians: opposite ones have no turn between them."""
ROUNDS = 6
"""Times that a ball is raised out of the material."""

Contacts = tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"], Float[ndarray, "k 3"]]
"""Ball centres, contact normals and tool axes."""
Poses = tuple[Float[ndarray, "m p 3"], Float[ndarray, "m p 3"]]
"""Ball centres and axes of the p poses of each link, its ends at the contacts left out."""


def direct_links(
    space: LinkSpace,
    ends: Contacts,
    starts: Contacts,
    short: float,
    lifts: Sequence[float] = LIFTS,
    arcs: Bool[ndarray, "k 2"] | None = None,
) -> list[LinkMoves | None]:
    """The lowest link from each end to its start, both left out, that removes nothing; None where it is too long,
    turns too far, passes the singularity, leaves the limits, or is not proven free. Straight links are no longer than
    `short`, mm; they are raised by one of the `lifts`, mm. `arcs`: whether the end, and the start, is that of an arc.
    """
    arcs = np.zeros((len(ends[0]), 2), dtype=bool) if arcs is None else arcs
    link_moves: list[LinkMoves | None] = [None] * len(ends[0])
    away = np.linalg.norm(starts[0] - ends[0], axis=1)
    turns = angles_between(ends[2], starts[2])
    left = np.flatnonzero((away <= short) & (turns <= MAX_TURN))
    feed = min(space.feeds.link, space.checker.cutter.feed)
    for lift, along in product(lifts, (1, 2)):
        if not len(left):
            break
        a, b = (contacts_of(contacts, left) for contacts in (ends, starts))
        links = _straight(a, b, lift * a[along], lift * b[along])
        left = left[~_take(link_moves, left, links=links, between=(a, b), arcs=arcs[left], space=space, feed=feed)]

    turns = np.maximum(turns, angles_between(ends[1], starts[1]))
    open_ = np.array([link is None for link in link_moves], dtype=bool)
    left = np.flatnonzero(open_ & (away <= LONG) & (turns <= MAX_LONG_TURN))
    if len(left):
        a, b = (contacts_of(contacts, left) for contacts in (ends, starts))
        taut = _taut(space, a, b)
        _take(link_moves, left, links=taut, between=(a, b), arcs=arcs[left], space=space, feed=space.feeds.link)
    return link_moves


def contacts_of(contacts: Contacts, which: Int[ndarray, " m"]) -> tuple[ndarray, ndarray, ndarray]:
    """Some of the contacts."""
    centres, normals, axes = contacts
    return centres[which], normals[which], axes[which]


def _take(
    link_moves: list[LinkMoves | None],
    which: Int[ndarray, " m"],
    links: Poses,
    between: tuple[Contacts, Contacts],
    arcs: Bool[ndarray, "m 2"],
    space: LinkSpace,
    feed: float,
) -> Bool[ndarray, " m"]:
    """Put those of the links that may be taken into `link_moves`, at `which`; whether each of them is."""
    axes = _off_singularity(*links)
    free = _free(space, (links[0], axes), *between, arcs)
    for k, c, v in zip(which[free], links[0][free], axes[free], strict=True):
        link_moves[k] = moves_of(MoveKind.LINK, c, v, feed)
    return free


def _straight(
    ends: Contacts, starts: Contacts, lifts: Float[ndarray, "m 3"], last_lifts: Float[ndarray, "m 3"]
) -> Poses:
    """Straight links between contacts that are lifted so."""
    return _poses(ends[0] + lifts, starts[0] + last_lifts, ends[2], starts[2], STEPS)


def _taut(space: LinkSpace, ends: Contacts, starts: Contacts) -> Poses:
    """Links that run over the material like taut strings."""
    (a, normals_a, axes_a), (b, normals_b, axes_b) = ends, starts
    line, axes = _poses(a, b, axes_a, axes_b, LONG_STEPS)
    _, normals = _poses(a, b, normals_a, normals_b, LONG_STEPS)
    wanted = space.ball_radius + ABOVE
    material = space.checker.scene.material_distance
    heights = np.full(line.shape[:2], ABOVE)
    for _ in range(ROUNDS):
        centres = (line + heights[:, :, None] * normals).reshape(-1, 3)
        heights += np.maximum(wanted - material.signed(centres, wanted), 0.0).reshape(heights.shape)
    return line + _envelope(heights)[:, :, None] * normals, axes


def _envelope(heights: Float[ndarray, "m p"]) -> Float[ndarray, "m p"]:
    """The least concave functions above the heights of each row."""
    envelope = heights.copy()
    for i, j in combinations(range(heights.shape[1]), 2):
        f = np.linspace(0, 1, j - i + 1)
        chord = (1 - f) * heights[:, i, None] + f * heights[:, j, None]
        envelope[:, i : j + 1] = np.maximum(envelope[:, i : j + 1], chord)
    return envelope


def _poses(
    first: Float[ndarray, "m 3"],
    last: Float[ndarray, "m 3"],
    first_axes: Float[ndarray, "m 3"],
    last_axes: Float[ndarray, "m 3"],
    steps: int,
) -> Poses:
    """The poses of `interpolate_poses`, one row a link."""
    centres, axes = interpolate_poses(first, last, first_axes, last_axes, steps)
    shape = (len(first), steps + 1, 3)
    return centres.reshape(shape), axes.reshape(shape)


def _off_singularity(centres: Float[ndarray, "m p 3"], axes: Float[ndarray, "m p 3"]) -> ndarray:
    """The axes, led round the singularity."""
    link = np.repeat(np.arange(len(axes)), axes.shape[1])
    return avoid_singularity(axes.reshape(-1, 3), centres.reshape(-1, 3), link).reshape(axes.shape)


def _free(
    space: LinkSpace, links: Poses, ends: Contacts, starts: Contacts, arcs: Bool[ndarray, "m 2"]
) -> Bool[ndarray, " m"]:
    """Whether each link keeps off the singularity and within the limits, removes nothing and is proven free, with the
    moves from its end and to its start."""
    centres, axes = links
    all_centres = np.concatenate([ends[0][:, None], centres, starts[0][:, None]], axis=1)
    all_axes = np.concatenate([ends[2][:, None], axes, starts[2][:, None]], axis=1)
    free = np.array([least_polar_angles(v).min() > SINGULAR_ANGLE for v in all_axes], dtype=bool)
    free &= space.limits.allow(axes.reshape(-1, 3)).reshape(axes.shape[:2]).all(axis=1)
    halfway = (centres[:, 1:] + centres[:, :-1]) / 2
    free[free] = space.in_air(np.concatenate([centres, halfway], axis=1)[free])
    for contacts, lifted in ((ends[0], centres[:, 0]), (starts[0], centres[:, -1])):
        rising = contacts[:, None] + LIFTED[:, None] * (lifted - contacts)[:, None]
        free[free] = space.left_in_air(contacts[free], rising[free])
    # the move onto a contact is a cut, the one onto an arc is not
    stops = np.where(arcs[:, 1], all_centres.shape[1], all_centres.shape[1] - 1)
    lines = [(all_centres[k, : stops[k]], all_axes[k, : stops[k]]) for k in np.flatnonzero(free)]
    free[free] = space.cuts_little(lines, [(c[:1], v[:1]) for c, v in lines], arcs[free].sum(axis=1))
    free[free] = _proven_free(space, all_centres[free], all_axes[free])
    return free


def _proven_free(
    space: LinkSpace, centres: Float[ndarray, "k p 3"], axes: Float[ndarray, "k p 3"]
) -> Bool[ndarray, " k"]:
    """Whether the straight moves through the p poses of each link are free of collision and gouge."""
    if not len(centres):
        return np.zeros(0, dtype=bool)
    count, poses = centres.shape[:2]
    flat_centres, flat_axes = centres.reshape(-1, 3), axes.reshape(-1, 3)
    joined = np.tile(np.r_[np.ones(poses - 1, dtype=bool), False], count)
    tips = space.checker.cutter.tips_of(flat_centres, flat_axes)
    free = space.checker.moves_free(tips, flat_axes, joined, cutting=True)
    moves = np.flatnonzero(joined)
    free[moves] &= space.ball_free(flat_centres[moves], flat_centres[moves + 1])
    return (free | ~joined).reshape(count, -1).all(axis=1)
