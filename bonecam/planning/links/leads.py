"""The lead arcs of the runs of a level, and the links from the far end of one to the far end of another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from bonecam.planning.links.direct import LIFTS, Contacts, contacts_of, direct_links
from bonecam.planning.links.lead_arc import OfLevel, arcs_from, arcs_to
from bonecam.planning.links.link_space import LinkSpace, Polyline
from bonecam.planning.links.moves import LinkMoves, Pose, join_moves, moves_of, without_rests
from bonecam.tool.path import MoveKind

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

    @property
    def far_ends(self) -> list[Pose]:
        """The poses at the far ends of the arcs."""
        return [(centres[-1], axes[-1]) for centres, axes in self.arcs]

    @property
    def numbers(self) -> frozenset[int]:
        """The numbers of the far ends."""
        return frozenset(range(self.contacts, self.contacts + len(self.arcs)))

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
