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
from bonecam.levels.sequence import Sequences

MENDS, SURER = 5, 3
"""How often a level is mended that fails, and one that only its certificate doubts."""
ACCEPTED = 0.01
"""Where no sequence keeps every tolerance, one that breaks depth, nesting or stock by no more (mm, the size
of the gouge tolerance) is taken. The report tells it."""
FAR, ALL_FAR = 0.1, 0.02
"""Levels that break a limit by more (mm) are not mended; nor is any where more than half of the levels fail
and one by more than that."""


def mend(inspection: Inspection, making: Sequences, *, doubts: bool = False) -> None:
    """Move the levels that failed (and those their certificates `doubts`) as little as keeps their limits,
    with the places watched that are near them, each MENDS times (with doubts SURER) at most. Levels next to
    each other that are no better for it stay as they were.

    Those above do not follow where only certificates doubt: what they lack is microns, and in a femur 110
    levels moved for it."""
    mended, watched, most = Counter[int](), defaultdict[int, list[ndarray]](list), SURER if doubts else MENDS
    while True:
        made, failed = (
            inspection.nets,
            {cut.level.index: cut for cut in inspection.failed + inspection.uncertain * doubts},
        )
        which = {
            k
            for k in failed
            if k < len(made) and inspection.trouble([k], doubts)[1] <= FAR and mended[k] < most
        }
        if not which or (len(failed) > len(made) / 2 and inspection.trouble(failed, doubts)[1] > ALL_FAR):
            return
        mended.update(which)
        for k, cut in enumerate(inspection.cuts, start=1):
            for near in (k - 1, k, k + 1):
                watched[near].append(cut.found.near_limits)
        folded = {k for k in which if failed[k].level.self_intersections and k + 1 < len(made)}
        before, places = inspection.copy(), {k: np.vstack(some) for k, some in watched.items()}
        attempt, moved = making.mended(made, which, folded, places, follow=not doubts)
        attempt = making.onward(attempt)
        fresh = range(len(made), len(attempt) + 1) if len(attempt) > len(made) else ()
        inspection.measure(attempt, sorted({*fresh, *(cut for k in moved for cut in (k, k + 1))}))
        for first, last in _runs(moved):
            after = last + 1 if last + 1 < len(made) else len(attempt)
            if inspection.trouble(range(first, after + 1), doubts) >= before.trouble(
                range(first, last + 2), doubts
            ):
                for k, cut in enumerate(inspection.cuts[first - 1 : after], start=first):
                    watched[k].append(cut.found.near_limits)
                inspection.restore(before, range(first, after + 1))


def surer(inspection: Inspection, making: Sequences) -> Inspection:
    """Levels of which at most the last cut fails with those that only their certificates doubt mended, and
    one more below the stock where the points that a sequence measures missed what is left in a slit or a pit;
    as they were where that breaks a measure."""
    last = inspection.cuts[-1]
    if any(cut is not last for cut in inspection.failed) or not (inspection.failed or inspection.uncertain):
        return inspection
    again, missed = inspection.copy(), _too_deep(last)
    try:
        mend(again, making, doubts=True)
        if _too_deep(again.cuts[-1]):
            longer = making.onward(again.nets, len(again.nets) + 1)
            again.measure(longer, range(len(again.nets), len(longer) + 1))
    except LevelError:
        return inspection
    return inspection if again.failed or (len(again.cuts) > len(inspection.cuts) and not missed) else again


def _too_deep(last: Cut) -> bool:
    """Whether the last cut is measured too deep, or may be by more than ACCEPTED."""
    return last.error is not None or last.over > ACCEPTED


def _runs(numbers: Sequence[int]) -> list[tuple[int, int]]:
    """First and last of those that follow each other; the numbers rise."""
    firsts, lasts = ([k for k in numbers if k + step not in numbers] for step in (-1, 1))
    return list(zip(firsts, lasts))
