"""Transfers: retract from one contact, traverse on the clearance surface, approach another contact.

Where no traverse is free, the transfer goes by way of the safe point above the stock.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bonecam.planning.links.link_space import LinkSpace, Polyline
from bonecam.planning.links.moves import LinkMoves, Pose, join_moves, moves_of
from bonecam.planning.links.retract import Retract, approach, find_retracts, safe_retract
from bonecam.planning.links.traverse import TraverseOptions, traverse
from bonecam.tool.path import MoveKind

TRAVERSES = (
    TraverseOptions(),
    TraverseOptions(long_way=True),
    TraverseOptions(rise=5.0),
    TraverseOptions(over_pole=True),
    TraverseOptions(rise=15.0, over_pole=True),
    TraverseOptions(rise=15.0),
    TraverseOptions(rise=15.0, long_way=True),
)
"""The traverses between two poses in the order they are tried: short and low first."""
SAFE = -1
"""The safe point, in the place of a contact's index."""


@dataclass(frozen=True, eq=False)
class Transfers:
    """The transfers found so far between contacts (by index into `poses`, or SAFE); None where there is none.

    A transfer leaves its first pose out, and its last one where that is a contact. `in_air` are the poses (by index)
    that are no contacts but stand in air: they are approached at the feed of links.
    """

    space: LinkSpace
    poses: Sequence[Pose]
    retracts: Mapping[int, Retract | None]
    found: Mapping[tuple[int, int], LinkMoves | None]
    traverses: Sequence[TraverseOptions] = TRAVERSES
    in_air: frozenset[int] = frozenset()

    def extend(self, pairs: Sequence[tuple[int, int]]) -> "Transfers":
        """The transfers, with those of more pairs of contacts; all pairs at once are quicker than one by one."""
        fresh = [pair for pair in dict.fromkeys(pairs) if pair not in self.found]
        contacts = dict.fromkeys(contact for pair in fresh for contact in pair)
        new = [contact for contact in contacts if contact not in self.retracts]
        behind_arc = np.array([k in self.in_air for k in new], dtype=bool)
        ways = find_retracts(self.space, [self.poses[k] for k in new], behind_arc)
        retracts = dict(self.retracts)
        for pose, led, way in zip(new, behind_arc, ways, strict=True):
            retracts[pose] = replace(way, entry_feed=self.space.feeds.link) if way and led else way

        ends = [(retracts[a], retracts[b]) for a, b in fresh]
        possible = [(out, into) for out, into in ends if out is not None and into is not None]
        moves = iter(_find_transfers(self.space, possible, self.traverses))
        links = [None if out is None or into is None else next(moves) for out, into in ends]
        return replace(self, retracts=retracts, found={**self.found, **dict(zip(fresh, links))})


def no_transfers(
    space: LinkSpace,
    poses: Sequence[Pose],
    traverses: Sequence[TraverseOptions] = TRAVERSES,
    in_air: frozenset[int] = frozenset(),
) -> Transfers:
    """Nothing found yet between these poses, of which some stand `in_air`; the `traverses` are tried in their order."""
    return Transfers(space, poses, retracts={SAFE: safe_retract(space)}, found={}, traverses=traverses, in_air=in_air)


def _find_transfers(
    space: LinkSpace, pairs: Sequence[tuple[Retract, Retract]], options: Sequence[TraverseOptions]
) -> list[LinkMoves | None]:
    """The transfer from the pose of each first retract to that of the second."""
    traverses = _find_traverses(space, [(out.end, into.end) for out, into in pairs], options)
    transfers = [
        None if moves is None else join_moves([out.moves, moves, approach(into, space.feeds)])
        for moves, (out, into) in zip(traverses, pairs, strict=True)
    ]
    blocked = [k for k, (out, into) in enumerate(pairs) if transfers[k] is None and len(out.moves) and len(into.moves)]
    if blocked:
        safe = safe_retract(space)
        home = _find_transfers(space, [(pairs[k][0], safe) for k in blocked], options)
        back = _find_transfers(space, [(safe, pairs[k][1]) for k in blocked], options)
        for k, first, second in zip(blocked, home, back, strict=True):
            transfers[k] = None if first is None or second is None else join_moves([first, second])
    return transfers


def _find_traverses(
    space: LinkSpace, pairs: Sequence[tuple[Pose, Pose]], tried: Sequence[TraverseOptions]
) -> list[LinkMoves | None]:
    """The first of those `tried` between each two poses on the clearance surface that is free, its first pose
    left out; the same one of all pairs is tried at once."""
    traverses: list[LinkMoves | None] = [None] * len(pairs)
    for options in tried:
        left = [k for k, moves in enumerate(traverses) if moves is None]
        routes = [traverse(space.surface, *pairs[k], space.limits, options) for k in left]
        for k, (centres, axes), free in zip(left, routes, _routes_free(space, routes), strict=True):
            if free:
                traverses[k] = moves_of(MoveKind.RAPID, centres[1:], axes[1:], space.feeds.rapid)
    return traverses


def _routes_free(space: LinkSpace, routes: Sequence[Polyline]) -> list[bool]:
    """Whether the axes of each route are within the limits, and its moves free."""
    free = np.array([space.limits.allow(axes).all() for _, axes in routes], dtype=bool)
    free[free] = space.polylines_free([route for route, ok in zip(routes, free) if ok], cutting=False)
    return free.tolist()
