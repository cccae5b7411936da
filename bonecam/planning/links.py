"""Moves between passes: retract, traverse round the stock, approach; or a direct link above the surface.

Direct links: from the end of one pass to the near start of the next, just above what stands between them.

A short link runs straight, as low as it can. A longer one runs over the material like a taut string: the straight line
is raised along the normals, which turn from the one end's to the other's, until the ball is off the material, and then
to the concave envelope of these heights.

Lead arcs: the ball comes onto its first contact, and leaves the last one, on an arc tangential to the cut.

The arc lies in the plane of the cut and of the contact's normal, or else of the tool axis; the axis stands still on it.
It removes nothing but what the cut behind it has removed, and is proven as links are. Onto a cut that begins in
material the first move of the cut is a chord of the arc. A smaller one is tried where a large one does not fit; where
none does, the way is straight.

The lead arcs of the runs of a level, and the links from the far end of one to the far end of another.

Links near the level from the end of each run to the begin of the next: a step over on the surface, or a direct link,
by way of lead arcs where there is room for them.

Steps over on the surface: from the end of one pass the tool cuts straight on to the near start of the next.

The links of a level: how its runs of contacts are reached one after the other, from the safe point and
back to it.

A run is cut without lifting the tool. One that cannot be left, or not be reached, loses its lead arcs; if that is not
enough, it is cut short by as little as lets the tool on and off; where nothing does, it is left out.

Lifts within a path: where the machine's rotary axes come to their limits between two rapids, the tool leaves for the
safe point above the stock, where they are rewound, and comes back to go on.

Between two cuts it comes back to the contact that it left, so that nothing stays between; else to the place where it
was to go.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise, product

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, dots, lengths, unit
from bonecam.errors import MachineError
from bonecam.planning.axes.lead import SINGULAR_ANGLE, avoid_singularity, least_polar_angles
from bonecam.planning.collision import interpolate_poses
from bonecam.planning.link_space import (
    ARC_ALLOWED,
    CUT_ALLOWED,
    NO_MOVES,
    SAFE,
    TRAVERSES,
    LinkMoves,
    LinkSpace,
    Polyline,
    Pose,
    Transfers,
    TraverseOptions,
    join_moves,
    moves_of,
    traverse,
    without_rests,
)
from bonecam.tool.path import ContactPath, MoveKind, ToolPath

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
        straight = _poses(a[0] + lift * a[along], b[0] + lift * b[along], a[2], b[2], STEPS)
        links = _free_links(space, straight, a, b, arcs[left], feed)
        for k, link in zip(left, links, strict=True):
            link_moves[k] = link
        left = left[[link is None for link in links]]

    turns = np.maximum(turns, angles_between(ends[1], starts[1]))
    open_ = np.array([link is None for link in link_moves], dtype=bool)
    left = np.flatnonzero(open_ & (away <= LONG) & (turns <= MAX_LONG_TURN))
    if len(left):
        a, b = (contacts_of(contacts, left) for contacts in (ends, starts))
        links = _free_links(space, _taut(space, a, b), a, b, arcs[left], space.feeds.link)
        for k, link in zip(left, links, strict=True):
            link_moves[k] = link
    return link_moves


def contacts_of(contacts: Contacts, which: Int[ndarray, " m"]) -> tuple[ndarray, ndarray, ndarray]:
    """Some of the contacts."""
    centres, normals, axes = contacts
    return centres[which], normals[which], axes[which]


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

    # The least concave functions above the heights of each row
    envelope = heights.copy()
    for i, j in combinations(range(line.shape[1]), 2):
        f = np.linspace(0, 1, j - i + 1)
        chord = (1 - f) * heights[:, i, None] + f * heights[:, j, None]
        envelope[:, i : j + 1] = np.maximum(envelope[:, i : j + 1], chord)
    return line + envelope[:, :, None] * normals, axes


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


def _free_links(
    space: LinkSpace, links: Poses, ends: Contacts, starts: Contacts, arcs: Bool[ndarray, "m 2"], feed: float
) -> list[LinkMoves | None]:
    """The links, led round the singularity; None where one does not keep off it and within the limits, removes
    something, or is not proven free, with the moves from its end and to its start."""
    centres, axes = links
    link = np.repeat(np.arange(len(axes)), axes.shape[1])
    axes = avoid_singularity(axes.reshape(-1, 3), centres.reshape(-1, 3), link).reshape(axes.shape)
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
    allowed = CUT_ALLOWED - ARC_ALLOWED * arcs[free].sum(axis=1)
    free[free] = space.cuts_little(lines, [(c[:1], v[:1]) for c, v in lines], allowed)
    free[free] = _proven_free(space, all_centres[free], all_axes[free])
    moves = zip(centres, axes, free, strict=True)
    return [moves_of(MoveKind.LINK, c, v, feed) if ok else None for c, v, ok in moves]


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


SWEEP = np.radians(80.0)
"""Angle of an arc, radians: at its far end the tool comes and goes nearly along the normal."""
ARC_STEPS = 5
"""Straight moves of an arc."""
SHARES = (1.0, 0.5, 0.25)
"""Radii of the arcs that are tried, as shares of the lead radius."""
TANGENT = np.radians(20.0)
"""A cut whose first move turns off by less from the move that leads to it (radians) begins tangentially."""
CHORDS = (1, 2)
"""Straight moves of an arc whose chord is the first move of the cut: the longer one turns off by 16 degrees."""
LEAST_SIDE = 0.5
"""A unit vector bends an arc to its side if as much of it stands across the cut."""
NEAR = 3.0
"""A cut has removed what lies round its end within so many radii of the ball."""


OfLevel = tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"]]
"""Ball centres, normals and axes of all contacts of a level, which runs index."""


def arcs_to(space: LinkSpace, contacts: OfLevel, runs: Sequence[Int[ndarray, " _"]]) -> list[Polyline | None]:
    """The largest arc of at most the lead radius of `space` that leads to the begin of each run, from the end of the
    first move of the cut back to its far end, all in air; None where there is room for none."""
    nothing = contacts[0][:0], contacts[2][:0]
    return _lead_arcs(space, contacts, [run[:2] for run in runs], [nothing] * len(runs))


def arcs_from(space: LinkSpace, contacts: OfLevel, runs: Sequence[Int[ndarray, " _"]]) -> list[Polyline | None]:
    """As `arcs_to`, the arcs that lead from the ends of the runs, behind what each has removed."""
    centres, _, axes = contacts
    around = NEAR * space.ball_radius
    near = [run[lengths(centres[run] - centres[run[-1]]) <= around] for run in runs]
    return _lead_arcs(space, contacts, [run[:-3:-1] for run in runs], [(centres[k], axes[k]) for k in near])


def _lead_arcs(
    space: LinkSpace, contacts: OfLevel, ends: Sequence[Int[ndarray, " _"]], removed: Sequence[Polyline]
) -> list[Polyline | None]:
    """The largest arc that leads away from the end of each cut, along its tangent; None where there is room for none.
    `ends` are the last contact of each cut and the one before, where there is one: else it has no direction.
    `removed` are the poses of the cut near its end that have removed material when the tool is there."""
    centres, _, axes = contacts
    angle = SWEEP * np.arange(1, ARC_STEPS + 1) / ARC_STEPS
    arcs: list[Polyline | None] = [None] * len(ends)
    for share, side, chord in product(SHARES, (1, 2), CHORDS):
        left = [k for k, arc in enumerate(arcs) if arc is None and len(ends[k]) > 1]
        if not left:
            break
        last, before = np.array([ends[k] for k in left]).T
        away = unit(centres[last] - centres[before])
        up = contacts[side][last]
        up = up - dots(up, away)[:, None] * away
        # a direction nearly along the cut bends to no side
        up = unit(np.where(lengths(up)[:, None] > LEAST_SIDE, up, np.nan))
        radius = share * space.lead_radius
        along, rise = (radius * f[:, None] for f in (np.sin(angle), 1 - np.cos(angle)))
        bent = centres[last][:, None] + along * away[:, None] + rise * up[:, None]
        lines = [
            (np.vstack([centre, arc[chord - 1 :]]), np.repeat(axis[None], ARC_STEPS + 2 - chord, axis=0))
            for centre, arc, axis in zip(centres[last], bent, axes[last], strict=True)
        ]
        for k in np.flatnonzero(_free_arcs(space, [removed[k] for k in left], lines)).tolist():
            arcs[left[k]] = lines[k][0][1:], lines[k][1][1:]
    return arcs


def begins_tangentially(before: Float[ndarray, "3"], cut: Float[ndarray, "n 3"]) -> bool:
    """Whether a cut through these ball centres begins in the direction in which the ball comes from `before`."""
    if len(cut) < 2:
        return False
    came = unit((cut[0] - before)[None])
    goes = unit((cut[1] - cut[0])[None])
    return bool(angles_between(came, goes)[0] <= TANGENT)


def _free_arcs(space: LinkSpace, removed: Sequence[Polyline], lines: Sequence[Polyline]) -> Bool[ndarray, " m"]:
    """Whether each arc, its contact first, removes nothing anew, and is proven free of collision and gouge."""
    free = np.array([np.isfinite(centres).all() for centres, _ in lines], dtype=bool)
    # the first move of a cut cuts
    links = [line if len(cut[0]) else (line[0][1:], line[1][1:]) for line, cut in zip(lines, removed)]
    for k in np.flatnonzero(free).tolist():
        centres = links[k][0]
        cut = removed[k][0]
        samples = np.vstack([centres[1:], (centres[1:] + centres[:-1]) / 2])
        if len(cut):
            nearest = cut[np.argmin(np.linalg.norm(samples[:, None] - cut[None], axis=2), axis=1)]
            free[k] = space.left_in_air(nearest, samples[:, None]).all()
        else:
            free[k] = space.in_air(np.vstack([centres[:1], samples])[None])[0]
    asked = np.flatnonzero(free).tolist()
    allowed = np.full(len(asked), ARC_ALLOWED)
    free[asked] = space.cuts_little([links[k] for k in asked], [removed[k] for k in asked], allowed)
    asked = np.flatnonzero(free).tolist()
    free[asked] = space.polylines_free([lines[k] for k in asked], cutting=True)
    return free


Run = Int[ndarray, " _"]
"""Contacts, by index, that are cut without lifting the tool."""


@dataclass(frozen=True, eq=False)
class Leads:
    """Arcs from behind a contact on; those, by index, on which the tool comes to contacts (`enter`) and goes from them
    (`leave`). Their far ends are numbered on behind the `contacts` of the level, so many."""

    contacts: int
    arcs: Sequence[Polyline] = ()
    enter: Mapping[int, int] = field(default_factory=dict)
    leave: Mapping[int, int] = field(default_factory=dict)

    def ends(self, run: Run) -> tuple[int, int]:
        """The poses, by number, that the tool comes to and goes from to cut a run."""
        first, last = int(run[0]), int(run[-1])
        begin, end = self.enter.get(first), self.leave.get(last)
        return first if begin is None else self.contacts + begin, last if end is None else self.contacts + end

    def without(self, runs: Sequence[Run]) -> "Leads":
        """The leads without the arcs of these runs."""
        firsts, lasts = {int(run[0]) for run in runs}, {int(run[-1]) for run in runs}
        enter = {contact: arc for contact, arc in self.enter.items() if contact not in firsts}
        return replace(self, enter=enter, leave={k: arc for k, arc in self.leave.items() if k not in lasts})

    def led(self, space: LinkSpace, link: LinkMoves, left: Run | None, entered: Run | None) -> LinkMoves:
        """A transfer from a run that is `left` to one that is `entered`, with their arcs."""
        out = None if left is None else self.leave.get(int(left[-1]))
        into = None if entered is None else self.enter.get(int(entered[0]))
        return with_arcs(space, link, *(None if k is None else self.arcs[k] for k in (out, into)))


def find_leads(space: LinkSpace, contacts: OfLevel, runs: Sequence[Run], direct: Sequence[LinkMoves | None]) -> Leads:
    """The arcs of the runs that no direct link leads to or away from; `contacts` are ball centres, normals and axes.
    None where `space.lead_radius` is 0, or a run is too short to have a direction."""
    count = len(contacts[0])
    if space.lead_radius <= 0:
        return Leads(count)
    begun = [run for run, link in zip(runs, [None, *direct], strict=True) if link is None]
    left = [run for run, link in zip(runs, [*direct, None], strict=True) if link is None]
    arcs: list[Polyline] = []
    enter: dict[int, int] = {}
    leave: dict[int, int] = {}
    for asked, place, leads, arc_of_contact in (
        (begun, 0, arcs_to(space, contacts, begun), enter),
        (left, -1, arcs_from(space, contacts, left), leave),
    ):
        for run, arc in zip(asked, leads, strict=True):
            if arc is not None:
                arc_of_contact[int(run[place])] = len(arcs)
                arcs.append(arc)
    return Leads(count, arcs, enter, leave)


def led_links(
    space: LinkSpace, contacts: OfLevel, ended: Sequence[Run], begun: Sequence[Run], short: float
) -> list[LinkMoves | None]:
    """The direct links from the ends of some runs to the begins of others, those left out, by way of lead arcs where
    there is room; None where there is no arc, and as `direct_links` has it."""
    out, into = arcs_from(space, contacts, ended), arcs_to(space, contacts, begun)
    asked = [k for k, pair in enumerate(zip(out, into, strict=True)) if pair != (None, None)]
    ends = _far_ends(contacts, [int(ended[k][-1]) for k in asked], [out[k] for k in asked])
    starts = _far_ends(contacts, [int(begun[k][0]) for k in asked], [into[k] for k in asked])
    arcs = np.array([(out[k] is not None, into[k] is not None) for k in asked], dtype=bool).reshape(-1, 2)
    links: list[LinkMoves | None] = [None] * len(out)
    for k, link in zip(asked, direct_links(space, ends, starts, short, (0.0, *LIFTS), arcs), strict=True):
        links[k] = None if link is None else with_arcs(space, link, out[k], into[k])
    return links


def with_arcs(space: LinkSpace, link: LinkMoves, out: Polyline | None, into: Polyline | None) -> LinkMoves:
    """A link between the far ends of arcs, with them, at the feed of cuts at most."""
    moves = [link]
    feed = min(space.feeds.link, space.checker.cutter.feed)
    if out is not None:
        moves.insert(0, moves_of(MoveKind.LINK, *out, feed))
    if into is not None:
        moves.append(moves_of(MoveKind.LINK, into[0][::-1], into[1][::-1], feed))
    return without_rests(join_moves(moves))


def _far_ends(contacts: OfLevel, indices: Sequence[int], arcs: Sequence[Polyline | None]) -> Contacts:
    """Contacts, by index, moved to the far ends of their arcs."""
    centres, normals, axes = contacts_of(contacts, np.array(indices, dtype=np.int64))
    for k, arc in enumerate(arcs):
        centres[k] = centres[k] if arc is None else arc[0][-1]
    return centres, normals, axes


def steps_over(space: LinkSpace, ends: Contacts, starts: Contacts, longest: float) -> Bool[ndarray, " k"]:
    """Whether the tool may cut straight from each end to its start: no farther than `longest` (mm), by a small turn off
    the singularity, no deeper than at the deepest of them all, proven free of collision and gouge."""
    may = np.linalg.norm(starts[0] - ends[0], axis=1) <= longest
    may &= angles_between(ends[2], starts[2]) <= MAX_TURN
    axes = np.stack([ends[2], starts[2]], axis=1)
    may &= np.array([least_polar_angles(pair).min() > SINGULAR_ANGLE for pair in axes], dtype=bool)
    may[may] = space.no_deeper_between(ends[0][may], starts[0][may])
    may[may] = space.ball_free(ends[0][may], starts[0][may])
    if not may.any():
        return may
    centres = np.stack([ends[0], starts[0]], axis=1)[may].reshape(-1, 3)
    turned = axes[may].reshape(-1, 3)
    joined = np.tile([True, False], int(may.sum()))
    free = space.checker.moves_free(space.checker.cutter.tips_of(centres, turned), turned, joined)
    may[may] = free[::2]
    return may


DIRECT_RADII = 2.5
"""A direct link is no longer than this many radii of the ball."""


def near_links(
    space: LinkSpace, path: ContactPath, axes: Float[ndarray, "n 3"], runs: Sequence[Run]
) -> tuple[list[Run], list[LinkMoves | None]]:
    """The runs, and the link near the level from each but the last to the next: no moves where the tool steps over on
    the surface, if it can to behind the ramp, which is then left out; else the direct link, or None."""
    longest = DIRECT_RADII * path.cutter.radius
    level = [run[np.argmin(path.ramp[run]) :] for run in runs]
    over = steps_over(space, *_between(path, axes, level), longest)
    runs = [flat if stepped else run for run, flat, stepped in zip(runs, level, np.r_[False, over])]

    links: list[LinkMoves | None] = [NO_MOVES] * len(over)
    apart = np.flatnonzero(~over)
    ends, starts = (contacts_of(contacts, apart) for contacts in _between(path, axes, runs))
    left = np.flatnonzero(~steps_over(space, ends, starts, longest))
    if space.lead_radius:
        ended, begun = ([runs[k + step] for k in apart[left]] for step in (0, 1))
        led = led_links(space, (path.centres, path.normals, axes), ended, begun, longest)
        for k, link in zip(apart[left], led, strict=True):
            links[k] = link
        left = left[[link is None for link in led]]
    direct = direct_links(space, contacts_of(ends, left), contacts_of(starts, left), longest)
    for k, link in zip(apart[left], direct, strict=True):
        links[k] = link
    return runs, links


def _between(path: ContactPath, axes: Float[ndarray, "n 3"], runs: Sequence[Run]) -> tuple[Contacts, Contacts]:
    """The last contacts of all runs but the last one, and the first ones of those that follow."""
    last = np.array([run[-1] for run in runs[:-1]], dtype=np.int64)
    first = np.array([run[0] for run in runs[1:]], dtype=np.int64)
    ends = path.centres[last], path.normals[last], axes[last]
    return ends, (path.centres[first], path.normals[first], axes[first])


SHORTER = (0, 1, 2, 4, 8, 16, 32, 64)
"""By so many contacts the ends of a run are cut short, the first that does."""


@dataclass(frozen=True, eq=False)
class LinkedRuns:
    """The `runs`, some of them shorter than they came; those that are reached, in order: each one's number and the
    moves to it; and the moves `home` from the last one (None where no run is reached)."""

    runs: tuple[Run, ...]
    links: tuple[tuple[int, LinkMoves], ...]
    home: LinkMoves | None


def link_runs(
    space: LinkSpace,
    poses: Sequence[Pose],
    runs: Sequence[Run],
    direct: Sequence[LinkMoves | None],
    leads: Leads | None = None,
) -> LinkedRuns:
    """Link runs (contacts, as indices into `poses`); `direct[k]` is the direct link from run k to the next,
    if there is one: without moves where the tool cuts straight on. Others begin and end on the arcs of the `leads`."""
    after = [*direct, None]
    leads = leads or Leads(len(poses))
    poses = [*poses, *((centres[-1], axes[-1]) for centres, axes in leads.arcs)]
    transfers = Transfers(space, poses, in_air=frozenset(range(leads.contacts, len(poses))))
    links = _links(transfers, runs, after, leads)
    if leads.arcs and len(links) < len(runs):
        reached = {k for k, _ in links}
        beside = [{k - 1, k, k + 1} & set(range(len(runs))) for k in range(len(runs))]
        leads = leads.without([run for run, near in zip(runs, beside, strict=True) if not near <= reached])
        links = _links(transfers, runs, after, leads)
    if len(links) < len(runs):
        missed = sorted(set(range(len(runs))) - {k for k, _ in links})
        # The runs, of which those `missed` end where the tool gets on and off, if it does so somewhere near their
        # ends; and their direct links, none at an end that moved.
        shortened, linked = list(runs), list(after)
        for k in missed:
            run = runs[k]
            head: int | None = 0
            if not k or linked[k - 1] is None:
                head = _first_linked(transfers, [(SAFE, int(contact)) for contact in run])
            tail = _first_linked(transfers, [(int(contact), SAFE) for contact in run[::-1]])
            if head is None or tail is None or head + tail >= len(run) - 1:
                continue
            shortened[k] = run[head : len(run) - tail]
            if head and k:
                linked[k - 1] = None
            if tail:
                linked[k] = None
        runs, after = shortened, linked
        links = _links(transfers, runs, after, leads)
    if not links:
        return LinkedRuns(tuple(runs), (), None)
    last = runs[links[-1][0]]
    (home,) = transfers.find([(leads.ends(last)[1], SAFE)])
    assert home is not None
    return LinkedRuns(tuple(runs), tuple(links), leads.led(space, home, last, None))


def _links(
    transfers: Transfers, runs: Sequence[Run], after: Sequence[LinkMoves | None], leads: Leads
) -> list[tuple[int, LinkMoves]]:
    """The runs that are reached, in order, each with the moves to it."""
    ends = [leads.ends(run) for run in runs]

    # Whether the tool gets away from the end of each run: directly to a run that it gets away from, or to the safe
    # point
    transfers.find([(end, SAFE) for (_, end), link in zip(ends, after) if link is None])
    leavable = [False] * len(ends)
    for k in reversed(range(len(ends))):
        directly = after[k] is not None and leavable[k + 1]
        leavable[k] = directly or transfers.find([(ends[k][1], SAFE)]) != [None]

    reachable = [k for k in range(len(runs)) if leavable[k]]
    jumps = [(a, b) for a, b in pairwise(reachable) if b > a + 1 or after[a] is None]
    first = [(SAFE, ends[k][0]) for k in reachable[:1]]
    transfers.find(first + [(ends[a][1], ends[b][0]) for a, b in jumps])

    links: list[tuple[int, LinkMoves]] = []
    for k in reachable:
        last = links[-1][0] if links else None
        link = after[last] if last is not None and last == k - 1 else None
        if link is None:
            (moves,) = transfers.find([(SAFE if last is None else ends[last][1], ends[k][0])])
            left = None if last is None else runs[last]
            link = None if moves is None else leads.led(transfers.space, moves, left, runs[k])
        if link is not None:
            links.append((k, link))
    return links


def _first_linked(transfers: Transfers, pairs: Sequence[tuple[int, int]]) -> int | None:
    """By how many contacts a run is cut short until a transfer of these is found."""
    return next((k for k in SHORTER if k < len(pairs) and transfers.find([pairs[k]]) != [None]), None)


LIFT_TRAVERSES = (TraverseOptions(one_azimuth=True), TraverseOptions(rise=5.0, one_azimuth=True), *TRAVERSES)
"""The traverses to the safe point and back in the order they are tried: first those on which an axis about Z that is at
its limit stands still."""


def lift_for_rewinds(path: ToolPath, space: LinkSpace) -> ToolPath:
    """The path with as few lifts as the machine's rotary axes need, where the tool gets away and back without
    collision; MachineError with the level where it does not, or its axes do not reach."""
    blocked = np.zeros(0)
    while space.limits.lift_places is not None:
        try:
            places, axes = space.limits.lift_places(path.axes, path.kinds, blocked)
        except MachineError as error:
            raise MachineError(f"level {path.level}, {error}", level=path.level, **error.evidence) from error
        if not len(places):
            break
        # The path with points at the places that are on the way between two rows, and the row behind each place.
        row = np.floor(places).astype(np.int64)
        fraction = (places - row)[:, None]
        inside = fraction[:, 0] > 0
        behind = row + 1 + np.cumsum(inside)
        source = np.insert(np.arange(len(path.tips)), row[inside] + 1, row[inside] + 1)
        points = (behind - 1)[inside]
        whole, rows = path.take(source), behind
        balls = (1 - fraction) * path.balls[row] + fraction * path.balls[row + 1]
        whole.axes[points] = axes[inside]
        whole.tips[points] = path.cutter.tips_of(balls, axes)[inside]
        for new, old in ((whole.parameters, path.parameters), (whole.contacts, path.contacts)):
            new[points] = ((1 - fraction) * old[row] + fraction * old[row + 1])[inside]
        if path.cones:
            new = np.isin(np.arange(len(source)), points)
            whole = replace(whole, cones=path.cones.at(np.where(new, -1, source)))
        # between two cuts the tool comes back to the contact that it left
        cut = whole.kinds == MoveKind.CUT
        lifts = list(zip(rows.tolist(), (rows - (cut[rows - 1] & cut[rows])).tolist(), strict=True))
        transfers = Transfers(space, list(zip(whole.balls, whole.axes)), LIFT_TRAVERSES)
        moves = transfers.find([pair for row, back in lifts for pair in ((row - 1, SAFE), (SAFE, back))])
        ways = list(zip(moves[::2], moves[1::2], strict=True))
        stuck = [k for k, way in enumerate(ways) if None in way]
        if not stuck:
            return _with_lifts(whole, lifts, ways, space.feeds.plunge)
        blocked = np.r_[blocked, places[stuck]]
    return path


def goes_on(before: ToolPath | None, path: ToolPath) -> bool:
    """Whether a path begins where the one `before` it ended, on its level and with its cutter."""
    if before is None or (before.level, before.cutter.number) != (path.level, path.cutter.number):
        return False
    return np.array_equal(before.tips[-1], path.tips[0]) and np.array_equal(before.axes[-1], path.axes[0])


ON_SURFACE = 1e-6
"""A pose so much below the clearance surface is on it, mm."""


def from_there(before: ToolPath | None, path: ToolPath, space: LinkSpace) -> ToolPath:
    """A path that would go on from the safe point, where the one `before` it has left the stock: on the clearance
    surface from there to its first approach. As it is, where no such way is free or rotary axes are rewound."""
    if before is None or not goes_on(before, path):
        return path

    def outside(path: ToolPath, rows: Int[ndarray, " k"]) -> Int[ndarray, " _"]:
        distance = space.surface.stock.signed_distance(path.balls[rows])
        return rows[(distance > space.surface.clearance - ON_SURFACE) & (path.kinds[rows] == MoveKind.RAPID)]

    cuts = np.flatnonzero(before.kinds == MoveKind.CUT)
    rapids = int(np.argmin(path.kinds == MoveKind.RAPID))
    if not len(cuts) or not rapids:
        return path
    left, reached = outside(before, np.arange(cuts[-1], len(before.tips))), outside(path, np.arange(rapids))
    if not len(left) or not len(reached):
        return path
    start, end = int(left[0]), int(reached[-1])
    ends = (before.balls[start], before.axes[start]), (path.balls[end], path.axes[end])
    for option in TRAVERSES:
        centres, axes = traverse(space.surface, *ends, space.limits, option)
        way = [(centres, axes)]
        if not space.limits.allow(axes).all() or not space.polylines_free(way, cutting=False)[0]:
            continue
        new = len(centres)
        whole = path.take(np.r_[np.full(new, end), np.arange(end + 1, len(path.tips))])
        # its ends as they are, to the last bit
        whole.tips[: new - 1] = path.cutter.tips_of(centres, axes)[:-1]
        whole.axes[: new - 1] = axes[:-1]
        whole.tips[0], whole.axes[0] = before.tips[start], before.axes[start]
        axes, kinds = np.vstack([before.axes, whole.axes]), np.r_[before.kinds, whole.kinds]
        with suppress(MachineError):  # axes that come to their limits are rewound at the safe point
            rewinds = space.limits.lift_places
            return whole if rewinds is None or not len(rewinds(axes, kinds, np.zeros(0))[0]) else path
    return path


def without_returns(paths: Sequence[ToolPath]) -> list[ToolPath]:
    """The paths, each ended where the next one goes on `from_there`."""
    ended = []
    for path, following in pairwise(paths):
        same = (path.tips == following.tips[0]).all(axis=1) & (path.axes == following.axes[0]).all(axis=1)
        here = np.flatnonzero(same & (path.cutter.number == following.cutter.number))
        ended.append(path.take(np.arange(here[-1] + 1)) if len(here) else path)
    return [*ended, *paths[-1:]]


def _with_lifts(
    path: ToolPath,
    lifts: Sequence[tuple[int, int]],
    ways: Sequence[tuple[LinkMoves | None, LinkMoves | None]],
    plunge_feed: float,
) -> ToolPath:
    """The path with lifts before some rows, by ways to the safe point and back; a contact that the tool comes back to
    is entered at the plunge feed and begins a pass of its own."""
    moves = []
    for up, down in ways:
        assert up is not None
        assert down is not None
        # on the spot the rotary axes turn
        spot = moves_of(MoveKind.RAPID, up.centres[-1:], up.axes[-1:], float(up.feeds[-1]))
        moves.append(join_moves([up, spot, down]))

    # The old row of each row of a path with lifts of some lengths, -1 on them
    rows = len(path.tips)
    lengths = [len(way) for way in moves]
    parts = []
    done = 0
    for (row, back), length in zip(lifts, lengths, strict=True):
        parts += [np.arange(done, row), np.full(length, -1)]
        done = back
    source = np.concatenate([*parts, np.arange(done, rows)])

    away = source < 0
    again = np.isin(source, [back for row, back in lifts if back < row]) & np.r_[False, away[:-1]]
    ends = np.flatnonzero(np.diff(away.astype(np.int64), prepend=0))
    passes = path.pass_index[source]

    joined = join_moves(moves)
    feed_rates = np.where(again, np.minimum(path.feed_rates[source], plunge_feed), path.feed_rates[source])
    names = ("kinds", "tips", "axes", "parameters", "contacts")
    arrays = {name: getattr(path, name)[source] for name in names} | {"feed_rates": feed_rates}
    arrays["kinds"][away] = joined.kinds
    arrays["tips"][away] = path.cutter.tips_of(joined.centres, joined.axes)
    arrays["axes"][away] = joined.axes
    arrays["feed_rates"][away] = joined.feeds
    arrays["parameters"][away] = np.nan
    arrays["contacts"][away] = np.nan
    arrays["pass_index"] = np.where(away | (passes < 0), -1, passes + np.cumsum(again))
    cones = path.cones.at(source) if path.cones else None
    return replace(path, **arrays, cones=cones, lifts=ends.reshape(-1, 2) - [0, 1])
