"""The links of a level: how its runs of contacts are reached one after the other, from the safe point and
back to it.

A run is cut without lifting the tool. Runs that cannot be left, or not be reached, are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from jaxtyping import Int
from numpy import ndarray

from bonecam.planning.links.link_space import LinkSpace
from bonecam.planning.links.moves import LinkMoves, Pose
from bonecam.planning.links.transfer import SAFE, Transfers, no_transfers


@dataclass(frozen=True, eq=False)
class LinkedRuns:
    """The runs that are reached, in order: each one's number and the moves to it; and the moves `home` from
    the last one (None where no run is reached)."""

    links: tuple[tuple[int, LinkMoves], ...]
    home: LinkMoves | None


def link_runs(
    space: LinkSpace,
    poses: Sequence[Pose],
    runs: Sequence[Int[ndarray, " _"]],
    direct: Sequence[LinkMoves | None],
) -> LinkedRuns:
    """Link runs (contacts, as indices into `poses`); `direct[k]` is the direct link from run k to the next,
    if there is one: without moves where the tool cuts straight on."""
    ends = [(int(run[0]), int(run[-1])) for run in runs]
    after = [*direct, None]
    transfers, leavable = _find_leavable(no_transfers(space, poses), ends, after)

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
            link = transfers.found[pair]
        if link is not None:
            links.append((k, link))
    if not links:
        return LinkedRuns((), None)

    pair = (ends[links[-1][0]][1], SAFE)
    home = transfers.extend([pair]).found[pair]
    assert home is not None
    return LinkedRuns(tuple(links), home)


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
