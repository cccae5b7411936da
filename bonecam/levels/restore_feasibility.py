"""Levels that do not pass as measured: moved as little as keeps their limits.

(Levels midway between the two of a cut that falls behind were no better: where levels slide along the
surface, what lies midway dips between them, by 0.007 mm on a femur.)
"""

from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from bonecam.errors import LevelError
from bonecam.levels.measure.inspection import Cut, Inspection
from bonecam.levels.sequence import SequenceMaker

RESTORATIONS = 5
"""How often a level that fails its check is moved. (Without, the levels of a lunate use 0.52 of their depth
instead of 0.97.)"""
CERTIFICATE_RESTORATIONS = 3
"""How often a level that only its certificate doubts is moved. (Without, a lunate loses one of 15 certificates.)"""
ACCEPTED = 0.01
"""Where no sequence keeps every tolerance, one that breaks depth, nesting or stock by no more (mm, the size
of the gouge tolerance) is taken. The report tells it."""
FAR, ALL_FAR = 0.1, 0.02
"""Levels that break a limit by more (mm) stay as they are; so do all where more than half of the levels fail
and one by more than the second."""


def restore_feasibility(inspection: Inspection, maker: SequenceMaker, *, doubts: bool = False) -> None:
    """Move the levels that failed their check (and those that their certificates doubt, with `doubts`) as little
    as keeps their limits.

    The places near the limits are watched too. Each level is moved RESTORATIONS times at most (with doubts
    CERTIFICATE_RESTORATIONS). Levels next to each other that are no better for it stay as they were.

    Levels above follow only where a measure failed: what a certificate lacks is microns, and in a femur 110
    levels moved for it.
    """
    tries = Counter[int]()
    watched = defaultdict[int, list[ndarray]](list)
    most = CERTIFICATE_RESTORATIONS if doubts else RESTORATIONS
    while True:
        levels = inspection.nets
        failed = {cut.level.index: cut for cut in inspection.failed + inspection.uncertain * doubts}
        which = {
            k
            for k in failed
            if k < len(levels) and inspection.trouble([k], doubts)[1] <= FAR and tries[k] < most
        }
        if not which or (len(failed) > len(levels) / 2 and inspection.trouble(failed, doubts)[1] > ALL_FAR):
            return
        tries.update(which)
        _watch_near_limits(watched, inspection)
        folded = {k for k in which if failed[k].level.self_intersections and k + 1 < len(levels)}
        places = {k: np.vstack(some) for k, some in watched.items()}
        attempt, moved = maker.restore_limits(levels, which, folded, places, follow=not doubts)
        _keep_what_is_better(inspection, maker.onward(attempt), moved, watched, doubts)


def _watch_near_limits(watched: defaultdict[int, list[ndarray]], inspection: Inspection) -> None:
    """Add to the places `watched` of each level those that are near a limit on it and on its neighbours."""
    for k, cut in enumerate(inspection.cuts, start=1):
        for near in (k - 1, k, k + 1):
            watched[near].append(cut.found.near_limits)


def _keep_what_is_better(
    inspection: Inspection,
    attempt: list[ndarray],
    moved: list[int],
    watched: defaultdict[int, list[ndarray]],
    doubts: bool,
) -> None:
    """Measure the levels that moved; runs of them that are no better stay as they were, and the places where
    they broke limits are `watched`."""
    before = inspection.copy()
    count = len(inspection.nets)
    fresh = range(count, len(attempt) + 1) if len(attempt) > count else ()
    inspection.measure(attempt, sorted({*fresh, *(cut for k in moved for cut in (k, k + 1))}))
    for first, last in _runs(moved):
        after = last + 1 if last + 1 < count else len(attempt)
        now = inspection.trouble(range(first, after + 1), doubts)
        if now >= before.trouble(range(first, last + 2), doubts):
            for k, cut in enumerate(inspection.cuts[first - 1 : after], start=first):
                watched[k].append(cut.found.near_limits)
            inspection.restore(before, range(first, after + 1))


def restore_certificates(inspection: Inspection, maker: SequenceMaker) -> Inspection:
    """The levels with those moved that only their certificates doubt, and with one more below the stock where
    the last cut is too deep: the points that a sequence measures may miss what is left in a slit or a pit.

    The levels as they are where others than the last fail, where that breaks a measure, or takes another cut
    that no measure asked for.
    """
    last = inspection.cuts[-1]
    if any(cut is not last for cut in inspection.failed) or not (inspection.failed or inspection.uncertain):
        return inspection
    again = inspection.copy()
    missed = _too_deep(last)
    try:
        restore_feasibility(again, maker, doubts=True)
        if _too_deep(again.cuts[-1]):
            longer = maker.onward(again.nets, len(again.nets) + 1)
            again.measure(longer, range(len(again.nets), len(longer) + 1))
    except LevelError:
        return inspection
    more_cuts = len(again.cuts) > len(inspection.cuts)
    return inspection if again.failed or (more_cuts and not missed) else again


def _too_deep(last: Cut) -> bool:
    """Whether the last cut is measured too deep, or may be by more than ACCEPTED."""
    return last.error is not None or last.over > ACCEPTED


def _runs(numbers: Sequence[int]) -> list[tuple[int, int]]:
    """First and last of the numbers that follow each other; they rise."""
    firsts, lasts = ([k for k in numbers if k + step not in numbers] for step in (-1, 1))
    return list(zip(firsts, lasts))
