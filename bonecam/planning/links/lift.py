"""Lifts within a path: where the machine's rotary axes come to their limits between two rapids, the tool leaves for the
safe point above the stock, where they are rewound, and comes back to go on.

Between two cuts it comes back to the contact that it left, so that nothing stays between; else to the place where it
was to go.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.errors import MachineError
from bonecam.machine.limits import LiftPlaces
from bonecam.planning.links.link_space import LinkSpace
from bonecam.planning.links.moves import LinkMoves, join_moves, moves_of
from bonecam.planning.links.transfer import SAFE, TRAVERSES, no_transfers
from bonecam.planning.links.traverse import TraverseOptions
from bonecam.tool.path import MoveKind, ToolPath

LIFTS = (TraverseOptions(one_azimuth=True), TraverseOptions(rise=5.0, one_azimuth=True), *TRAVERSES)
"""The traverses to the safe point and back in the order they are tried: first those on which an axis about Z that is at
its limit stands still."""


def lift_for_rewinds(path: ToolPath, space: LinkSpace) -> ToolPath:
    """The path with as few lifts as the machine's rotary axes need, where the tool gets away and back without
    collision; MachineError with the level where it does not, or its axes do not reach."""
    blocked = np.zeros(0)
    while space.limits.lift_places is not None:
        places, axes = _places(path, space.limits.lift_places, blocked)
        if not len(places):
            break
        whole, rows = _with_points(path, places, axes)
        lifts = [(row, _return(whole, row)) for row in rows.tolist()]
        pairs = [((row - 1, SAFE), (SAFE, back)) for row, back in lifts]
        poses = list(zip(whole.balls, whole.axes))
        transfers = no_transfers(space, poses, LIFTS).extend([one for pair in pairs for one in pair]).found
        stuck = [k for k, pair in enumerate(pairs) if any(transfers[one] is None for one in pair)]
        if not stuck:
            return _with_lifts(whole, lifts, transfers, space.feeds.plunge)
        blocked = np.r_[blocked, places[stuck]]
    return path


def _places(
    path: ToolPath, lift_places: LiftPlaces, blocked: Float[ndarray, " b"]
) -> tuple[Float[ndarray, " k"], Float[ndarray, "k 3"]]:
    """The places from which the path is to be lifted, in order, and the axes there."""
    try:
        return lift_places(path.axes, path.kinds, blocked)
    except MachineError as error:
        raise MachineError(f"level {path.level}, {error}", level=path.level, **error.evidence) from error


def _with_points(
    path: ToolPath, places: Float[ndarray, " k"], axes: Float[ndarray, "k 3"]
) -> tuple[ToolPath, Int[ndarray, " k"]]:
    """The path with points at the places that are on the way between two rows, and the row behind each place."""
    row = np.floor(places).astype(np.int64)
    fraction = (places - row)[:, None]
    inside = fraction[:, 0] > 0
    behind = row + 1 + np.cumsum(inside)
    source = np.insert(np.arange(len(path.tips)), row[inside] + 1, row[inside] + 1)
    points = (behind - 1)[inside]
    names = ("kinds", "pass_index", "feed_rates", "parameters", "contacts", "tips", "axes")
    arrays = {name: getattr(path, name)[source] for name in names}
    balls = (1 - fraction) * path.balls[row] + fraction * path.balls[row + 1]
    arrays["axes"][points] = axes[inside]
    arrays["tips"][points] = path.cutter.tips_of(balls, axes)[inside]
    for name in ("parameters", "contacts"):
        values = getattr(path, name)
        arrays[name][points] = ((1 - fraction) * values[row] + fraction * values[row + 1])[inside]
    new = np.isin(np.arange(len(source)), points)
    cones = path.cones.at(np.where(new, -1, source)) if path.cones else None
    return replace(path, **arrays, cones=cones), behind


def _return(path: ToolPath, row: int) -> int:
    """The row that the tool comes back to from a lift before `row`."""
    return row - 1 if path.kinds[row - 1] == path.kinds[row] == MoveKind.CUT else row


def _with_lifts(
    path: ToolPath,
    lifts: Sequence[tuple[int, int]],
    transfers: Mapping[tuple[int, int], LinkMoves | None],
    plunge_feed: float,
) -> ToolPath:
    """The path with lifts before some rows; a contact that the tool comes back to is entered at the plunge feed and
    begins a pass of its own."""
    moves = [_there_and_back(transfers[row - 1, SAFE], transfers[SAFE, back]) for row, back in lifts]

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


def _there_and_back(up: LinkMoves | None, down: LinkMoves | None) -> LinkMoves:
    """The moves to the safe point and from there, with one on the spot between them, for the rotary axes to turn."""
    assert up is not None
    assert down is not None
    spot = moves_of(MoveKind.RAPID, up.centres[-1:], up.axes[-1:], float(up.feeds[-1]))
    return join_moves([up, spot, down])
