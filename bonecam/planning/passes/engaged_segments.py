"""What of a level's lines is cut: stretches that would only rub are left out, and every stretch is entered on a
ramp.

The depth at a contact is how far the ball enters the material that stands, R - |C - M|, with C its centre and
M the nearest place of the material: also in a hollow or beside the post, where a larger ball has left a
fillet.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.planning.passes.patterns.order import SIDE_STEP

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
