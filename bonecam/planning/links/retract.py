"""Retracts: from a contact off the surface, at the link feed until the whole tool keeps the clearance, then rapid
to the clearance surface. Backwards they are the approaches, whose last part is at the plunge feed where it leads onto
a contact.

A retract runs along the tool axis, or bends off into a direction that is level or rises, so that a drooping
holder does not sink to the table; or, where none of these is free, into one that leans from the axis to some side.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import perpendicular
from bonecam.machine.limits import polar_angles, with_polar_angles
from bonecam.planning.axes.lead import LEAVING
from bonecam.planning.links.link_space import IN_AIR, LinkSpace, Polyline
from bonecam.planning.links.moves import NO_MOVES, Feeds, LinkMoves, Pose
from bonecam.tool.path import MoveKind

RAPID_MARGIN = 0.15
"""Rapids begin and end where the tool is farther from the material than the clearance by this much, mm."""
POLAR_ANGLES = np.radians([90.0, 70.0, 45.0])
"""Polar angles (radians) of the directions that a drooping axis is left in."""
BENDS = (0.0, 1.5, LEAVING)
"""Lengths along the axis before a retract bends off, mm: the ball may have to leave a hollow first."""
MIN_LENGTH = 1.0
"""Length of a retract at least, mm."""
LEANS = np.radians([8.0, 16.0, 30.0])
"""Angles (radians) from the tool axis of the directions that are tried last: between twisted blades the way out is not
along the axis."""
AROUND = 8
"""So many of them round the axis at each angle."""
LENGTHS = np.array([0, 0.1, 0.25, 0.5, 1, 1.5, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 26, 34, 45, 60, 80], dtype=np.float64)
"""Lengths of a retract (mm) at which it is checked, and at one of which the rapid part may begin; BENDS are
among them."""
DEEPEST = 0.05
"""How deep (mm) a retract may go into what stands beside its contact where none is in air: a ball of 2 mm removes
0.016 mm3 so."""
MIN_LAST_STEP = 0.05
"""The last of these lengths is at least this much before the end of the retract, mm."""


@dataclass(frozen=True, eq=False)
class Departure:
    """How a contact is left: so far along the tool axis (mm), and then in a direction."""

    along_axis: float
    direction: Float[ndarray, "3"]


@dataclass(frozen=True, eq=False)
class Retract:
    """The moves from a pose to the clearance surface, and the pose they end at; no moves where the tool is
    there already. Backwards its links go at `entry_feed` (mm/min)."""

    moves: LinkMoves
    end: Pose
    entry_feed: float


def safe_retract(space: LinkSpace) -> Retract:
    """The retract from the safe point, where nothing has to be done."""
    return Retract(NO_MOVES, space.safe_pose, space.feeds.link)


def approach(retract: Retract, feeds: Feeds) -> LinkMoves:
    """The retract backwards from its end, the contact left out: rapids, then links at its entry feed."""
    out = retract.moves
    kinds = out.kinds[:0:-1]
    speeds = np.where(kinds == MoveKind.LINK, retract.entry_feed, feeds.rapid)
    return LinkMoves(kinds, out.centres[-2::-1], out.axes[-2::-1], speeds)


def departures(axis: Float[ndarray, "3"]) -> list[Departure]:
    """The ways to leave a contact in the order they are tried: along the axis; then level or rising at once; then the
    same behind longer BENDS; then at once in directions that lean from the axis."""
    angle = float(polar_angles(axis[None])[0])
    rising = [with_polar_angles(axis[None], np.array([limit]))[0] for limit in POLAR_ANGLES if angle > limit]
    side = perpendicular(axis[None])[0]
    turns = 2 * np.pi * np.arange(AROUND) / AROUND
    ring = np.outer(np.cos(turns), side) + np.outer(np.sin(turns), np.cross(axis, side))
    leaning = [np.cos(lean) * axis + np.sin(lean) * each for lean in LEANS for each in ring]
    ways = [Departure(0.0, axis)] + [Departure(bend, d) for bend in BENDS for d in rising]
    return ways + [Departure(0.0, d) for d in leaning if d[2] >= min(axis[2], 0.0)]


def find_retracts(
    space: LinkSpace, poses: Sequence[Pose], behind_arc: Bool[ndarray, " n"] | None = None
) -> list[Retract | None]:
    """The first departure of each pose that is proven free and in air, or else the first that is free and goes no
    deeper than DEEPEST; None where there is none. The same departure of all poses is tried at once. Those that lie
    `behind_arc` share with their arc what may be removed."""
    arcs = np.zeros(len(poses), dtype=np.int64) if behind_arc is None else behind_arc.astype(np.int64)
    choices = [departures(axis) for _, axis in poses]
    retracts: list[Retract | None] = [None] * len(poses)
    entering: list[list[_Way]] = [[] for _ in poses]
    for k in range(max((len(ways) for ways in choices), default=0)):
        left = [i for i, ways in enumerate(choices) if retracts[i] is None and k < len(ways)]
        tried = _free_ways(space, [poses[i] for i in left], [choices[i][k] for i in left], arcs[left])
        for i, way in zip(left, tried, strict=True):
            if way is not None and _in_air(space, way.link, IN_AIR):
                retracts[i] = way.retract
            elif way is not None:
                entering[i].append(way)
    return [retract or _shallow(space, ways) for retract, ways in zip(retracts, entering, strict=True)]


class _Way(NamedTuple):
    """A retract that is proven free, and the ball centres of its link at which it is checked."""

    retract: Retract
    link: Float[ndarray, "n 3"]


def _shallow(space: LinkSpace, ways: Sequence[_Way]) -> Retract | None:
    """The first of the ways that goes no deeper than DEEPEST; None where there is none."""
    return next((way.retract for way in ways if _in_air(space, way.link, DEEPEST)), None)


def _free_ways(
    space: LinkSpace, poses: Sequence[Pose], chosen: Sequence[Departure], arcs: Int[ndarray, " n"]
) -> list[_Way | None]:
    """The retract of each pose by its departure; None where its ball cuts, or it is not proven free. Rays are asked
    before: in a pocket most departures cut, and the proofs take ten times as long."""
    ways = list(zip(poses, chosen, _lengths(space, poses, chosen), strict=True))
    lines = [_polyline(*way) for way in ways]
    starts = [(centre[None], axis[None]) for centre, axis in poses]
    little = np.flatnonzero(space.cuts_little(lines, starts, arcs)).tolist()
    free_ways: list[_Way | None] = [None] * len(poses)
    proven = _proven_ways(space, [lines[i] for i in little], [ways[i] for i in little])
    for i, way in zip(little, proven, strict=True):
        free_ways[i] = way
    return free_ways


def _proven_ways(
    space: LinkSpace, lines: Sequence[Polyline], ways: Sequence[tuple[Pose, Departure, Float[ndarray, " _"]]]
) -> list[_Way | None]:
    """The retract on each line, by a departure at some lengths; None where it is not proven free."""
    if not lines:
        return []

    # The point of each retract from which on the tool keeps the clearance: links turn to rapids there
    centres = np.vstack([line[0] for line in lines])
    axes = np.vstack([line[1] for line in lines])
    free = space.checker.free_in_air(centres, axes, RAPID_MARGIN)
    standoffs = []
    for here in np.split(free, np.cumsum([len(line[0]) for line in lines])[:-1]):
        near = np.flatnonzero(~here)
        first_far = int(near[-1]) + 1 if len(near) else 1
        standoffs.append(min(first_far, len(here) - 1))

    links = [(c[: k + 1], v[: k + 1]) for (c, v), k in zip(lines, standoffs, strict=True)]
    free = space.polylines_free(links, cutting=True)
    rapid = [i for i in np.flatnonzero(free).tolist() if standoffs[i] + 1 < len(lines[i][0])]
    rapids = [(lines[i][0][standoffs[i] :], lines[i][1][standoffs[i] :]) for i in rapid]
    free[rapid] = space.polylines_free(rapids, cutting=False)
    free[rapid] &= space.rapids_cut_nothing(rapids)
    retracts = [
        _retract(space.feeds, line, lengths, departure, standoff)
        for line, (_, departure, lengths), standoff in zip(lines, ways, standoffs, strict=True)
    ]
    return [_Way(retracts[i], links[i][0]) if ok else None for i, ok in enumerate(free)]


def _in_air(space: LinkSpace, centres: Float[ndarray, "n 3"], deepest: float) -> bool:
    """Whether the ball goes no deeper than `deepest` (mm) on its way from the contact that comes first."""
    halfway = (centres[1:] + centres[:-1]) / 2
    return bool(space.left_in_air(centres[:1], np.vstack([centres[1:], halfway])[None], deepest)[0])


def _lengths(space: LinkSpace, poses: Sequence[Pose], chosen: Sequence[Departure]) -> list[Float[ndarray, " r"]]:
    """The lengths (mm) of each retract from its contact (0) to the clearance surface at which it is
    checked."""
    if not poses:
        return []
    along = np.array([departure.along_axis for departure in chosen])
    corners = np.array([c + d.along_axis * axis for (c, axis), d in zip(poses, chosen, strict=True)])
    directions = np.array([departure.direction for departure in chosen])
    whole = np.maximum(along + space.surface.exit_lengths(corners, directions), MIN_LENGTH)
    return [np.r_[LENGTHS[length - MIN_LAST_STEP > LENGTHS], length] for length in whole]


def _polyline(pose: Pose, departure: Departure, lengths: Float[ndarray, " r"]) -> Polyline:
    """Ball centres and axes of a retract at the given lengths."""
    centre, axis = pose
    along_axis = np.outer(np.minimum(lengths, departure.along_axis), axis)
    beyond = np.outer(np.maximum(lengths - departure.along_axis, 0), departure.direction)
    return centre + along_axis + beyond, np.repeat(axis[None], len(lengths), axis=0)


def _retract(
    feeds: Feeds, line: Polyline, lengths: Float[ndarray, " r"], departure: Departure, standoff: int
) -> Retract:
    """Link to the standoff and rapid from there to the end, in straight moves but for the bend."""
    centres, axes = line
    bend = np.flatnonzero((lengths == departure.along_axis) & (lengths > 0))
    stops = np.unique(np.r_[bend, standoff, len(centres) - 1])
    is_link = stops <= standoff
    kinds = np.where(is_link, int(MoveKind.LINK), int(MoveKind.RAPID))
    speeds = np.where(is_link, feeds.link, feeds.rapid)
    moves = LinkMoves(kinds, centres[stops], axes[stops], speeds)
    return Retract(moves, (centres[-1], axes[-1]), feeds.plunge)
