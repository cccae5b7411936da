"""The links of a level: how its runs of contacts are reached one after the other, from the safe point and
back to it.

A run is cut without lifting the tool. One that cannot be left, or not be reached, loses its lead arcs; if that is not
enough, it is cut short by as little as lets the tool on and off; where nothing does, it is left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from bonecam.planning.links.leads import Leads, Run
from bonecam.planning.links.link_space import LinkSpace
from bonecam.planning.links.moves import LinkMoves, Pose
from bonecam.planning.links.transfer import SAFE, Transfers, no_transfers

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
    transfers = no_transfers(space, [*poses, *leads.far_ends], in_air=leads.numbers)
    transfers, links = _links(transfers, runs, after, leads)
    if leads.arcs and len(links) < len(runs):
        leads = leads.without(_missed(runs, links))
        transfers, links = _links(transfers, runs, after, leads)
    if len(links) < len(runs):
        missed = sorted(set(range(len(runs))) - {k for k, _ in links})
        transfers, runs, after = _shortened(transfers, runs, after, missed)
        transfers, links = _links(transfers, runs, after, leads)
    if not links:
        return LinkedRuns(tuple(runs), (), None)
    last = runs[links[-1][0]]
    pair = (leads.ends(last)[1], SAFE)
    home = transfers.extend([pair]).found[pair]
    assert home is not None
    return LinkedRuns(tuple(runs), tuple(links), leads.led(space, home, last, None))


def _missed(runs: Sequence[Run], links: Sequence[tuple[int, LinkMoves]]) -> list[Run]:
    """The runs that are not reached, and those beside them."""
    reached = {k for k, _ in links}
    return [run for k, run in enumerate(runs) if not {k - 1, k, k + 1} & set(range(len(runs))) <= reached]


def _links(
    transfers: Transfers, runs: Sequence[Run], after: Sequence[LinkMoves | None], leads: Leads
) -> tuple[Transfers, list[tuple[int, LinkMoves]]]:
    """The runs that are reached, in order, each with the moves to it."""
    ends = [leads.ends(run) for run in runs]
    transfers, leavable = _find_leavable(transfers, ends, after)

    reachable = [k for k in range(len(runs)) if leavable[k]]
    jumps = [(a, b) for a, b in pairwise(reachable) if b > a + 1 or after[a] is None]
    first = [(SAFE, ends[k][0]) for k in reachable[:1]]
    transfers = transfers.extend(first + [(ends[a][1], ends[b][0]) for a, b in jumps])

    links: list[tuple[int, LinkMoves]] = []
    for k in reachable:
        last = links[-1][0] if links else None
        link = after[last] if last is not None and last == k - 1 else None
        if link is None:
            pair = (SAFE if last is None else ends[last][1], ends[k][0])
            transfers = transfers.extend([pair])
            moves = transfers.found[pair]
            left = None if last is None else runs[last]
            link = None if moves is None else leads.led(transfers.space, moves, left, runs[k])
        if link is not None:
            links.append((k, link))
    return transfers, links


def _shortened(
    transfers: Transfers, runs: Sequence[Run], after: Sequence[LinkMoves | None], missed: Sequence[int]
) -> tuple[Transfers, list[Run], list[LinkMoves | None]]:
    """The runs, of which those `missed` end where the tool gets on and off, if it does so somewhere near their ends;
    and their direct links, none at an end that moved."""
    shorter, links = list(runs), list(after)
    for k in missed:
        run = runs[k]
        head: int | None = 0
        if not k or links[k - 1] is None:
            transfers, head = _first_linked(transfers, [(SAFE, int(contact)) for contact in run])
        transfers, tail = _first_linked(transfers, [(int(contact), SAFE) for contact in run[::-1]])
        if head is None or tail is None or head + tail >= len(run) - 1:
            continue
        shorter[k] = run[head : len(run) - tail]
        if head and k:
            links[k - 1] = None
        if tail:
            links[k] = None
    return transfers, shorter, links


def _first_linked(transfers: Transfers, pairs: Sequence[tuple[int, int]]) -> tuple[Transfers, int | None]:
    """By how many contacts a run is cut short until a transfer of these is found."""
    for short in (short for short in SHORTER if short < len(pairs)):
        transfers = transfers.extend([pairs[short]])
        if transfers.found[pairs[short]] is not None:
            return transfers, short
    return transfers, None


def _find_leavable(
    transfers: Transfers, ends: Sequence[tuple[int, int]], after: Sequence[LinkMoves | None]
) -> tuple[Transfers, list[bool]]:
    """Whether the tool gets away from the end of each run: directly to a run that it gets away from, or to
    the safe point."""
    transfers = transfers.extend([(end, SAFE) for (_, end), link in zip(ends, after) if link is None])
    leavable = [False] * len(ends)
    for k in reversed(range(len(ends))):
        if after[k] is not None and leavable[k + 1]:
            leavable[k] = True
            continue
        pair = (ends[k][1], SAFE)
        transfers = transfers.extend([pair])
        leavable[k] = transfers.found[pair] is not None
    return transfers, leavable
