"""Gouge avoidance for a ball: its centre is lifted along the contact normal until the ball stays out of what
must remain.

A ball of radius R gouges where the distance of its centre to the obstacle is below R. The true contact cannot
be reached where the ball does not fit (a groove sharper than the ball, a neighbouring condyle): there the
centre is lifted, and the lift is part of the answer. Distances are 1-Lipschitz, so a centre that lacks d mm
is free after a lift of d mm at the earliest, and places between two known distances are bounded
(`mesh/distance.lowest_between`).

What of a level's lines is cut: stretches that would only rub are left out, and every stretch is entered on a
ramp.

The depth at a contact is how far the ball enters the material that stands, R - |C - M|, with C its centre and
M the nearest place of the material: also in a hollow or beside the post, where a larger ball has left a
fillet.

The contacts and ball centres of a level on the curves of a pattern (`patterns/`).

`along`: lines s = const, as published (Gan et al. 2014, section 4.3); at the poles of a closed bone, where they crowd,
only those that are needed. `published`: all of them, whole. `round`: lines t = const, from the free end down to the
post. `iso-scallop`: curves along the part, each at the local step from the one before. `spiral`: one curve round the
part. `bands`: bands round the part with lines of their own.

The error of a level none of whose contacts can be machined.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import ToolPathError
from bonecam.job import PathJob
from bonecam.levels.measure import MachinedLevel, RoundedLevel
from bonecam.material.in_process_stock import InProcessStock
from bonecam.mesh.distance import MeshDistance, lowest_between
from bonecam.mesh.smooth_surface import nearest_areas
from bonecam.planning.patterns import SIDE_STEP, LineContacts, order_curves, pattern_curves, post_rings
from bonecam.planning.spacing import MAX_STEP, contact_frames, sample_lines
from bonecam.tool.cutter import MAX_DEPTH_RADII, Cutter
from bonecam.tool.path import ContactPath
from bonecam.workholding.post import Column, Post

MAX_ROUNDS = 40
"""Rounds of lifting, or of halving moves, after which what is still undecided counts as gouging."""
CONTACT_SHARE = 0.2
"""Part of the gouge tolerance that a ball at rest on a contact may use up."""
MOVE_SHARE = 0.5
"""Part of the gouge tolerance that a ball may use up on a move between two contacts."""
BETWEEN_SHARE = 0.6
"""Part of the gouge tolerance that it may use up between the places where the move is measured: with the mesh and the
control's way no more than all of it."""
FLUTE_SHARE = 0.6
"""Part of the gouge tolerance that the flutes above a ball may use up: more than the ball beside them on a move, and
with the mesh and the control's way no more than all of it."""
MESH_SHARE = 0.2
"""Part of the gouge tolerance that the mesh of the part may take, which balls are kept out of."""
POSTING_SHARE = 0.2
"""Part of the gouge tolerance by which the control may leave the path."""
WORD_ROUNDING = 0.001
"""Words with three decimals put the ball no further off than this, mm."""
INNER_FRACTIONS = (0.25, 0.75)
"""Fractions of a move at which it is measured besides its ends and its middle."""
OVERLIFT = 1.2
"""A lift is the distance lacking times this: where the normal leans to the obstacle, the distance grows by
less than the lift."""


def planned_tolerance(allowed: float) -> float:
    """The gouge tolerance (mm) that paths are planned with where `allowed` mm are.

    Where balls are measured the shares leave a tenth for the rounding of words, which is enough from ten times that on;
    between these places and for flutes they leave nothing, so that a smaller tolerance is planned without the rounding.
    """
    if allowed >= 10 * WORD_ROUNDING:
        return allowed
    return (allowed - WORD_ROUNDING) / (max(BETWEEN_SHARE, FLUTE_SHARE) + MESH_SHARE + POSTING_SHARE)


def flute_slack(allowed: float) -> float:
    """How deep (mm) the flutes of a cutter may be planned into the mesh of the part where a gouge of `allowed` mm is
    tolerated: the cutter is thinner by that when it is held against the part."""
    return FLUTE_SHARE * planned_tolerance(allowed)


def gouge_free_lifts(
    contacts: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    radius: float,
    tolerance: float,
    obstacles: Sequence[MeshDistance],
    joined: Bool[ndarray, " n"],
    max_lift: float,
) -> Float[ndarray, " n"]:
    """How far each ball centre (contact + (radius + lift) * normal) has to be lifted, mm; 0 where the ball
    fits.

    `joined[i]` says that the tool moves straight from contact i to contact i + 1 (the last entry is False):
    the moves are kept free too, all along. NaN where more than `max_lift` mm would be needed.
    """
    at_contact = radius - CONTACT_SHARE * tolerance
    lifts = np.zeros(len(contacts))
    changed = np.arange(len(contacts))
    moves = np.flatnonzero(joined)

    for _ in range(MAX_ROUNDS):
        lifts[changed] = _lift_contacts(
            contacts[changed],
            normals[changed],
            lifts=lifts[changed],
            radius=radius,
            wanted=at_contact,
            obstacles=obstacles,
            max_lift=max_lift,
        )
        centres = contacts + (radius + lifts)[:, None] * normals
        moves = moves[np.isfinite(lifts[moves]) & np.isfinite(lifts[moves + 1])]
        lacking = _most_lacking(centres, moves, radius, tolerance, obstacles)
        gouging = lacking > 0
        if not gouging.any():
            return lifts

        moves = moves[gouging]
        more = lacking[gouging] + CONTACT_SHARE * tolerance
        raised = np.zeros(len(lifts))
        np.maximum.at(raised, moves, more)
        np.maximum.at(raised, moves + 1, more)
        lifts = lifts + raised
        lifts[lifts > max_lift] = np.nan
        changed = np.flatnonzero((raised > 0) & np.isfinite(lifts))
        moves = np.flatnonzero(joined & ((raised > 0) | np.r_[raised[1:] > 0, False]))

    lifts[moves] = lifts[moves + 1] = np.nan
    return lifts


def moves_gouge_free(
    starts: Float[ndarray, "m 3"], ends: Float[ndarray, "m 3"], radius: float, tolerance: float, obstacle: MeshDistance
) -> Bool[ndarray, " m"]:
    """Whether the ball, its centre moved straight from start to end, stays within `tolerance` (mm) of free.

    Proven everywhere on the move, by halving it until its parts are bounded by the distances at their ends. A
    depth of MOVE_SHARE of the tolerance is let through, one of BETWEEN_SHARE never.
    """
    measured = radius - MOVE_SHARE * tolerance
    bounded = radius - BETWEEN_SHARE * tolerance
    free = np.ones(len(starts), dtype=bool)
    move = np.arange(len(starts))
    lengths = np.linalg.norm(ends - starts, axis=1)
    near = obstacle.signed(starts, radius + lengths)
    far = obstacle.signed(ends, radius + lengths)

    for _ in range(MAX_ROUNDS):
        free[move[np.minimum(near, far) < measured]] = False
        lengths = np.linalg.norm(ends - starts, axis=1)
        lowest = lowest_between(np.maximum(near, 0.0), np.maximum(far, 0.0), lengths)
        undecided = free[move] & (lowest < bounded)
        if not undecided.any():
            return free

        move, near, far = move[undecided], near[undecided], far[undecided]
        starts, ends = starts[undecided], ends[undecided]
        middles = (starts + ends) / 2
        halfway = obstacle.signed(middles, radius + lengths[undecided])
        starts, ends = np.vstack([starts, middles]), np.vstack([middles, ends])
        near, far = np.r_[near, halfway], np.r_[halfway, far]
        move = np.r_[move, move]

    free[move] = False
    return free


def _most_lacking(
    centres: Float[ndarray, "n 3"],
    moves: Int[ndarray, " m"],
    radius: float,
    tolerance: float,
    obstacles: Sequence[MeshDistance],
) -> Float[ndarray, " m"]:
    """How far (mm) the worst place of each move from centre i to i + 1 has to rise; 0 where the move is
    free."""
    at_contact = radius - CONTACT_SHARE * tolerance
    on_move = radius - MOVE_SHARE * tolerance
    lacking = np.max([_lacking(o, centres, moves, at_contact, on_move) for o in obstacles], axis=0)

    # Which of the moves that lack nothing where `_lacking` measures them enter an obstacle in between: only long ones
    # can, the others are proven by the distances there
    bounded = radius - BETWEEN_SHARE * tolerance
    quarters = np.linalg.norm(centres[moves + 1] - centres[moves], axis=1) / 4
    long = (quarters / 2) ** 2 > on_move**2 - bounded**2
    doubtful = np.flatnonzero((lacking <= 0) & long)
    starts, ends = centres[moves[doubtful]], centres[moves[doubtful] + 1]
    free = [moves_gouge_free(starts, ends, radius, tolerance, obstacle) for obstacle in obstacles]
    unproven = doubtful[~np.all(free, axis=0)]

    lacking[unproven] = CONTACT_SHARE * tolerance
    return np.asarray(lacking)


def _lacking(
    obstacle: MeshDistance, centres: Float[ndarray, "n 3"], moves: Int[ndarray, " m"], at_contact: float, on_move: float
) -> Float[ndarray, " m"]:
    """By how much the distance falls below `on_move` (mm) along the move from centre i to centre i + 1.

    Measured in the middle of the move; where the bound between the middle and the ends (which are at least
    `at_contact` away) does not rule a lack out, at INNER_FRACTIONS too.
    """
    starts = centres[moves]
    ends = centres[moves + 1]
    half = np.linalg.norm(ends - starts, axis=1) / 2
    # a move that is shorter than the distance of its end from the surface cannot cross the surface
    distance = obstacle.unsigned if (half < at_contact).all() else obstacle.signed
    middle = distance((starts + ends) / 2, at_contact)
    lacking = np.maximum(on_move - middle, 0.0)

    ends_away = np.full(len(moves), at_contact)
    lowest = lowest_between(ends_away, np.clip(middle, 0.0, at_contact), half)
    unsure = np.flatnonzero(lowest < on_move)
    for fraction in INNER_FRACTIONS:
        points = (1 - fraction) * starts[unsure] + fraction * ends[unsure]
        lacking[unsure] = np.maximum(lacking[unsure], on_move - distance(points, on_move))
    return lacking


def _lift_contacts(
    contacts: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    lifts: Float[ndarray, " n"],
    radius: float,
    wanted: float,
    obstacles: Sequence[MeshDistance],
    max_lift: float,
) -> Float[ndarray, " n"]:
    """The lifts (mm) at which each ball centre is `wanted` away from all obstacles; NaN above `max_lift`."""
    lifts = lifts.copy()
    gouging = np.arange(len(contacts))
    for _ in range(MAX_ROUNDS):
        centres = contacts[gouging] + (radius + lifts[gouging])[:, None] * normals[gouging]
        lacking = wanted - np.min([obstacle.signed(centres, wanted) for obstacle in obstacles], axis=0)
        gouging, lacking = gouging[lacking > 0], lacking[lacking > 0]
        if not len(gouging):
            return lifts

        lifts[gouging] += OVERLIFT * lacking + 0.1 * (radius - wanted)
        lifts[gouging[lifts[gouging] > max_lift]] = np.nan
        gouging = gouging[np.isfinite(lifts[gouging])]

    lifts[gouging] = np.nan
    return lifts


UNCERTAIN = 0.01
"""The depth at a contact is known to this, mm: places of the material are 0.25 mm apart."""
SHORT_GAP = 8.0
"""A gap of a pass that is shorter is not worth a retract, mm: 0.5 s at 900 mm/min."""
USELESS_GAP = 3.0
"""A gap between useful contacts of a pass that is shorter is cut, mm: a link beside the material takes as long."""
BESIDE = 2
"""A stretch begins and ends so many contacts beside the depth that asks for it: in air."""
LEAST_CONTACTS = 3
"""A stretch of fewer contacts is not worth a plunge."""
SLOPE = 0.3
"""Slope of the ramps: 17 degrees, what solid ball cutters are allowed in solid material."""
CLOSED = 1e-6
"""Contacts of a line that are nearer to each other are one, mm."""
LEAST_RAMP = 0.03
"""No ramp is made for less depth, mm."""


@dataclass(frozen=True, eq=False)
class Lines:
    """The contacts of a level's lines in machining order: number of the line, ball centre and outward normal of
    each. A closed line ends where it begins."""

    line: Int[ndarray, " n"]
    centres: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]

    def closed(self, first: int, last: int) -> bool:
        """Whether these two contacts are one place, where a line closes."""
        return bool(np.linalg.norm(self.centres[last] - self.centres[first]) < CLOSED)


@dataclass(frozen=True)
class DepthLimits:
    """The largest depth (`limit`) of a cut, what it may be deeper where the cutter before left a `scallop`, the
    `least` depth that is worth a cut, and the depth of the steps of rest paths where they may be deeper, mm."""

    limit: float = np.inf
    scallop: float = 0.0
    least: float = 0.0
    step: float = 0.0

    @property
    def deepest(self) -> float:
        """The largest depth that may be measured at a contact, mm. One at which the ball is deeper is left out where
        no step could be cut before it."""
        return self.limit + self.scallop + UNCERTAIN

    @property
    def of_step(self) -> "DepthLimits":
        """The depths of a step of a rest path."""
        return replace(self, limit=max(self.limit, self.step))


Run = tuple[Int[ndarray, " _"], Float[ndarray, "_ 3"], int]
"""Contacts by index, what their centres are moved by (mm), and how many of them first are a ramp."""
ANYTHING = DepthLimits()
"""Every depth is allowed."""


@dataclass(frozen=True, eq=False)
class EngagedSegments:
    """Passes in machining order: contacts by `index`, what their centres are moved by (mm), the number of the pass of
    each, and whether it is on the `ramp` of its pass. `short` are the contacts of stretches that are not worth a
    plunge."""

    index: Int[ndarray, " m"]
    raised: Float[ndarray, "m 3"]
    passes: Int[ndarray, " m"]
    ramp: Bool[ndarray, " m"]
    short: Int[ndarray, " k"]


def whole_passes(lines: Lines, usable: Bool[ndarray, " n"]) -> EngagedSegments:
    """One pass over every stretch that is usable."""
    runs = split_runs(lines, usable)
    return engaged_segments_of([(run, np.zeros((len(run), 3)), 0) for run in runs])


def cutting_passes(
    lines: Lines,
    usable: Bool[ndarray, " n"],
    depth: Float[ndarray, " n"],
    allowed: DepthLimits,
    in_air: Bool[ndarray, " n"],
) -> EngagedSegments:
    """The passes over what is usable and deep enough, entered on ramps. They may begin, end and go on over what is
    `in_air`: the strip that the edge of a bar takes is no longer than a step or two."""
    deep = usable & (depth >= allowed.least)
    passable = usable | in_air
    cut = filled(lines, beside(lines, deep, BESIDE) & passable, passable, SHORT_GAP)
    return _entered_segments(lines, cut, depth, allowed)


def useful_passes(
    lines: Lines,
    useful: Bool[ndarray, " n"],
    passable: Bool[ndarray, " n"],
    depth: Float[ndarray, " n"],
    allowed: DepthLimits,
) -> EngagedSegments:
    """The passes over what is `useful` behind the passes before, over gaps that are `passable` and short, and beside
    stretches that are too short alone."""
    cut = filled(lines, useful, passable, USELESS_GAP)
    few = np.zeros(len(useful), dtype=bool)
    for run in split_runs(lines, cut):
        few[run] = len(run) < LEAST_CONTACTS
    cut = filled(lines, cut | beside(lines, few, BESIDE) & passable, passable, USELESS_GAP)
    return _entered_segments(lines, cut, depth, allowed)


def _entered_segments(
    lines: Lines, cut: Bool[ndarray, " n"], depth: Float[ndarray, " n"], allowed: DepthLimits
) -> EngagedSegments:
    """The passes over what is cut, entered on ramps."""
    runs = split_runs(lines, cut)
    short = [run for run in runs if len(run) < LEAST_CONTACTS]
    flat = np.zeros((len(depth), 3))
    return engaged_segments_of(in_turn(lines, entered_runs(lines, runs, depth, flat, allowed.limit)), short)


def split_runs(lines: Lines, kept: Bool[ndarray, " n"]) -> list[Int[ndarray, " _"]]:
    """The stretches of contacts that are kept. A closed line with a gap begins behind its first one."""
    runs: list[ndarray] = []
    # First contact of each line, and the number of contacts behind the last; `line` never decreases
    for a, b in pairwise(np.searchsorted(lines.line, np.arange(lines.line[-1] + 2)).tolist()):
        here = np.arange(a, b)
        gap = np.flatnonzero(~kept[here])
        if len(gap) and kept[a] and kept[b - 1] and lines.closed(a, b - 1):
            here = np.r_[here[gap[0] : -1], here[: gap[0]]]
        place = np.flatnonzero(kept[here])
        if len(place):
            runs += np.split(here[place], np.flatnonzero(np.diff(place) > 1) + 1)
    return runs


def filled(lines: Lines, kept: Bool[ndarray, " n"], usable: Bool[ndarray, " n"], length: float) -> Bool[ndarray, " n"]:
    """`kept` with the gaps between two kept contacts of a line that are usable throughout and shorter than
    `length` mm."""
    index = np.flatnonzero(kept)
    after = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(lines.centres, axis=0), axis=1))]
    unusable = np.cumsum(~usable)
    first, last = index[:-1], index[1:]
    short = (last > first + 1) & (after[last] - after[first] < length)
    short &= (lines.line[first] == lines.line[last]) & (unusable[first] == unusable[last])
    change = np.zeros(len(kept) + 1, dtype=np.int64)
    np.add.at(change, first[short], 1)
    np.add.at(change, last[short], -1)
    return kept | (np.cumsum(change)[:-1] > 0)


def beside(lines: Lines, kept: Bool[ndarray, " n"], count: int) -> Bool[ndarray, " n"]:
    """`kept` with `count` contacts on both sides of each on its line."""
    same = lines.line[1:] == lines.line[:-1]
    for _ in range(count):
        wider = kept.copy()
        wider[:-1] |= same & kept[1:]
        wider[1:] |= same & kept[:-1]
        kept = wider
    return kept


def entered_runs(
    lines: Lines,
    runs: list[Int[ndarray, " _"]],
    depth: Float[ndarray, " n"],
    raised: Float[ndarray, "n 3"],
    limit: float,
) -> list[Run]:
    """The runs that are worth a plunge, raised and with their ramps."""
    rest = np.clip(depth - np.linalg.norm(raised, axis=1), 0.0, limit)
    return [_entered(lines, run, raised[run], float(rest[run[0]])) for run in runs if len(run) >= LEAST_CONTACTS]


def in_turn(lines: Lines, runs: list[Run]) -> list[Run]:
    """The runs from the first one on, each followed by one that begins near its end: the next of the lines that begin
    at most SIDE_STEP farther than the nearest. At a pole, where all lines end, so the next one cuts beside the last,
    not in full material across the pole."""
    if not runs:
        return []
    begins = np.array([lines.centres[index[0]] + raised[0] for index, raised, _ in runs])
    ends = np.array([lines.centres[index[-1]] + raised[-1] for index, raised, _ in runs])
    order = [0]
    open_ = np.ones(len(runs), dtype=bool)
    open_[0] = False
    while open_.any():
        away = np.where(open_, np.linalg.norm(begins - ends[order[-1]], axis=1), np.inf)
        ahead = (np.arange(len(runs)) - order[-1]) % len(runs)
        order.append(int(np.argmin(np.where(away <= away.min() + SIDE_STEP, ahead, len(runs)))))
        open_[order[-1]] = False
    return [runs[k] for k in order]


def _entered(lines: Lines, run: Int[ndarray, " r"], raised: Float[ndarray, "r 3"], depth: float) -> Run:
    """A run with a ramp before it where it begins in material of this depth (mm): along the end of a whole
    closed line, else from further on back to the run's begin."""
    if depth <= LEAST_RAMP or len(run) < 2:
        return run, raised, 0
    whole = lines.closed(int(run[0]), int(run[-1]))
    back = np.arange(len(run))[-1:0:-1] if whole else np.arange(len(run))
    centres = lines.centres[run[back]]
    behind = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1))]
    count = min(int(np.searchsorted(behind, depth / SLOPE)) + 1, len(back))
    # from far to near; the run's own begin follows
    ramp = back[1:count][::-1]
    share = behind[1:count][::-1] / max(behind[count - 1], np.finfo(float).tiny)
    up = (share * depth)[:, None] * lines.normals[run[ramp]]
    return np.r_[run[ramp], run], np.vstack([raised[ramp] + up, raised]), len(ramp)


def engaged_segments_of(found: Sequence[Run], short: Sequence[ndarray] = ()) -> EngagedSegments:
    """The runs as passes, one after the other."""
    none = np.zeros(0, dtype=np.int64)
    return EngagedSegments(
        np.concatenate([none, *(index for index, _, _ in found)]),
        np.vstack([np.zeros((0, 3)), *(raised for _, raised, _ in found)]),
        np.repeat(np.arange(len(found)), [len(index) for index, _, _ in found]),
        np.concatenate([none, *(np.arange(len(index)) < ramp for index, _, ramp in found)]).astype(bool),
        np.concatenate([none, *short]),
    )


WHY_NOTHING = {
    "post": "are too near the post: take a thinner post (holding.diameter) or a smaller cutter",
    "gouge": "lie where the ball does not fit: take a smaller cutter",
    "covered": "lie under what the levels round it left uncut: give the tool more room there, by a longer "
    "overhang, a slimmer holder, a longer or thinner post",
}
"""What to do where a level cannot be cut at all, by the reason that most of its contacts have."""


POST_CLEARANCE = 0.1
"""The ball keeps this far from the post, mm."""
MIN_THICKNESS = 0.002
"""Less material than this (mm) above a contact is air: a fifth of the gouge allowed by default."""
MAX_LIFT_RADII = 0.5
"""A ball lifted by more than this many radii does not machine the level any more: its contact is left out."""


def at_post(
    points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], post: Post, radius: float
) -> Bool[ndarray, " n"]:
    """Which places of the part stay at the post: those under it, and those that a ball of `radius` (mm) which keeps
    off the post leaves round it."""
    centres = points + radius * normals
    return np.minimum(post.distance(points), post.distance(centres) - POST_CLEARANCE) < radius


@dataclass(frozen=True, eq=False)
class CandidateContacts:
    """All contacts on the lines of a level in machining order, before any is left out.

    `line` is the number of each contact's line; a ring has its first contact again at its end. `lifts` as
    `gouge_free_lifts` has them, NaN where the ball does not fit. `at_post`: too near the post; `in_air`: there
    is nothing to cut. The ball stays out of the `obstacles` by the `gouge_tolerance` (mm).
    """

    level: MachinedLevel
    cutter: Cutter
    line: Int[ndarray, " n"]
    parameters: Float[ndarray, "n 2"]
    contacts: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    feeds: Float[ndarray, "n 3"]
    lifts: Float[ndarray, " n"]
    centres: Float[ndarray, "n 3"]
    at_post: Bool[ndarray, " n"]
    in_air: Bool[ndarray, " n"]
    obstacles: tuple[MeshDistance, ...]
    gouge_tolerance: float

    @property
    def lines(self) -> Lines:
        """The lines of the contacts."""
        return Lines(self.line, self.centres, self.normals)

    @property
    def usable(self) -> Bool[ndarray, " n"]:
        """The contacts that the ball reaches and that have something to cut, whatever stands on them."""
        return ~(self.at_post | np.isnan(self.lifts) | self.in_air)

    def depths(self, material: InProcessStock) -> Float[ndarray, " n"]:
        """How deep the ball enters the material at each contact, mm."""
        return material.depths(self.centres, self.cutter.radius)[0]

    def path_of(self, segments: EngagedSegments) -> ContactPath:
        """The path over segments of these contacts; none of them is told uncut."""
        kept = segments.index
        return ContactPath(
            level=self.level.index,
            cutter=self.cutter,
            pass_index=segments.passes,
            parameters=self.parameters[kept],
            contacts=self.contacts[kept],
            normals=self.normals[kept],
            feeds=self.feeds[kept],
            centres=self.centres[kept] + segments.raised,
            lifts=self.lifts[kept],
            ramp=segments.ramp,
            uncut=np.zeros((0, 3)),
            reasons=(),
        )


def candidate_contacts(
    level: MachinedLevel,
    obstacles: Sequence[MeshDistance],
    cutter: Cutter,
    post: Post,
    job: PathJob,
    *,
    turn_speed: float = np.inf,
    post_clearance: float = POST_CLEARANCE,
    walls: Sequence[LineContacts] = (),
    kept_off: Sequence[Column] = (),
) -> CandidateContacts:
    """The contacts of a level whatever the material: cusps <= cutter.scallop, chords <= job.chord_tolerance,
    no gouge beyond job.gouge_tolerance. ValueError where `job.pattern` needs a surface of another kind.

    `turn_speed` (rad/min) is that of the axis that changes the azimuth; it decides what is fastest.
    `obstacles` are what the ball must not enter: the level and the part; the lines of `walls` follow those of the
    pattern. A ball that enters a column that is `kept_off`, below the post, counts as at the post.
    """
    surface = level.surface
    curves = pattern_curves(surface, job.pattern, cutter, turn_speed)
    curves = order_curves(surface, curves, job.direction)
    lines = sample_lines(surface, curves, cutter.radius, job.chord_tolerance, MAX_STEP)
    line = lines.line
    parameters, directions = curves.at(line, lines.x)
    contacts, normals, feeds = contact_frames(surface, parameters, directions)
    rings = post_rings(surface, post, cutter.radius, cutter.radius + post_clearance)
    for added in [*walls, *rings]:
        line = np.r_[line, np.full(len(added.parameters), line[-1] + 1)]
        parameters = np.vstack([parameters, added.parameters])
        contacts = np.vstack([contacts, added.contacts])
        normals = np.vstack([normals, added.normals])
        feeds = np.vstack([feeds, added.feeds])

    joined = np.r_[line[1:] == line[:-1], False]
    max_lift = MAX_LIFT_RADII * cutter.radius
    tolerance = planned_tolerance(job.gouge_tolerance)
    lifts = gouge_free_lifts(contacts, normals, cutter.radius, tolerance, obstacles, joined=joined, max_lift=max_lift)
    centres = contacts + (cutter.radius + np.nan_to_num(lifts))[:, None] * normals
    at_post = post.distance(centres) < cutter.radius + post_clearance
    for column in kept_off:
        at_post |= column.distance(centres) < cutter.radius
    in_air = np.zeros(len(contacts), dtype=bool)
    if isinstance(level, RoundedLevel):
        in_air = level.stock.signed_distance(contacts) > -MIN_THICKNESS
    return CandidateContacts(
        level=level,
        cutter=cutter,
        line=line,
        parameters=parameters,
        contacts=contacts,
        normals=normals,
        feeds=feeds,
        lifts=lifts,
        centres=centres,
        at_post=at_post,
        in_air=in_air,
        obstacles=tuple(obstacles),
        gouge_tolerance=tolerance,
    )


def contact_path(
    candidates: CandidateContacts,
    material: InProcessStock | None = None,
    allowed: DepthLimits = ANYTHING,
    deepest: float = np.inf,
) -> ContactPath:
    """The contacts of a level that can be machined while `material` is left on it, but for where the ball would
    remove less than is `allowed`.

    Left out are contacts too near the post (`post`), under more material than MAX_DEPTH_RADII or where the ball would
    enter it by more than `deepest` mm (`covered`: an outer level was left uncut there), or where the ball does not fit
    (`gouge`). Those lifted by more than the scallop are listed as uncut (`gouge`) though the lifted ball still passes
    over them. Of a level that rounds the edges of the stock only what lies inside the stock is covered, which may be
    nothing. Raises ToolPathError where nothing is left of another level.
    """
    level, cutter, lifts = candidates.level, candidates.cutter, candidates.lifts
    blocked = np.isnan(lifts)
    covered = np.zeros(len(lifts), dtype=bool)
    if material is not None:
        depth = material.thickness(level, candidates.contacts) - np.nan_to_num(lifts)
        covered = ~candidates.at_post & ~blocked & (depth > MAX_DEPTH_RADII * cutter.radius)
        if np.isfinite(deepest):
            covered |= candidates.usable & (candidates.depths(material) > deepest)

    left_out = candidates.at_post | blocked | covered | candidates.in_air
    uncut = ~candidates.in_air & (left_out | (lifts > cutter.scallop))
    reasons = np.select([candidates.at_post[uncut], covered[uncut]], ["post", "covered"], "gouge")
    if left_out.all() and not isinstance(level, RoundedLevel):
        names, counts = np.unique(reasons, return_counts=True)
        most = str(names[np.argmax(counts)])
        area = float(nearest_areas(level.mesh, candidates.contacts[uncut])[reasons == most].sum())
        what = f"{counts.max()} of its {len(reasons)} contacts ({area:.1f} mm2) {WHY_NOTHING[most]}"
        evidence = {"level": level.index, "reason": most, "area_mm2": area}
        raise ToolPathError(f"level {level.index}: nothing can be cut: {what}", **evidence)
    segments = _stretches(candidates, ~left_out, material, allowed)

    # Usable moves that no stretch passes over
    passed = np.zeros(len(lifts), dtype=bool)
    passed[segments.index] = True
    same = candidates.line[1:] == candidates.line[:-1]
    trimmed = same & ~left_out[1:] & ~left_out[:-1] & ~(passed[1:] & passed[:-1])
    return replace(
        candidates.path_of(segments),
        uncut=np.vstack([candidates.contacts[uncut], candidates.contacts[segments.short]]),
        reasons=(*reasons.tolist(), *("short",) * len(segments.short)),
        trimmed=float(np.linalg.norm(np.diff(candidates.centres, axis=0), axis=1)[trimmed].sum()),
    )


def _stretches(
    candidates: CandidateContacts, usable: Bool[ndarray, " n"], material: InProcessStock | None, allowed: DepthLimits
) -> EngagedSegments:
    """The passes over the usable contacts where they are worth a cut, also behind the passes before them."""
    lines = candidates.lines
    if material is None or not np.isfinite(allowed.limit):
        return whole_passes(lines, usable)
    in_air = candidates.in_air & ~(candidates.at_post | np.isnan(candidates.lifts))
    depths = candidates.depths(material)
    segments = cutting_passes(lines, usable, depths, allowed, in_air)
    if allowed.least <= 0 or not candidates.level.index or isinstance(candidates.level, RoundedLevel):
        # what stays on the part is not cut later; and the places of the material do not follow the edges of a bar
        return segments
    radius = candidates.cutter.radius
    centres = candidates.centres[segments.index] + segments.raised
    useful = np.zeros(len(usable), dtype=bool)
    lowers = material.useful(candidates.level, centres, segments.passes, radius, allowed.least)
    useful[segments.index[lowers]] = True
    return useful_passes(lines, useful & usable, usable | in_air, depths, allowed)
