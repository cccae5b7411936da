"""Levels that do not pass as measured: moved as little as keeps their limits.

(Levels midway between the two of a cut that falls behind were no better: where levels slide along the
surface, what lies midway dips between them, by 0.007 mm on a femur.)
"""

from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from bonecam.errors import LevelError
from bonecam.levels.measure.inspection import Inspection, excess_bound, inspect_again, trouble, with_cuts_of
from bonecam.levels.sequences.sequence_maker import SequenceMaker
from bonecam.progress import Progress, silent

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


def restore_feasibility(
    inspection: Inspection, maker: SequenceMaker, *, doubts: bool = False, progress: Progress = silent
) -> Inspection:
    """The sequence with the levels that failed their check (and those that their certificates doubt, with
    `doubts`) moved as little as keeps their limits, measured again.

    The places near the limits are watched too. Each level is moved RESTORATIONS times at most (with doubts
    CERTIFICATE_RESTORATIONS). Levels next to each other that are no better for it stay as they were.

    Levels above follow only where a measure failed: what a certificate lacks is microns, and in a femur 110
    levels moved for it.
    """
    tries = Counter[int]()
    watched = defaultdict[int, list[ndarray]](list)
    most = CERTIFICATE_RESTORATIONS if doubts else RESTORATIONS
    while True:
        levels = inspection.control_points
        failed = {level.index: level for level in inspection.failed + inspection.uncertain * doubts}
        which = {
            k for k in failed if k < len(levels) and trouble([failed[k]], doubts=doubts)[1] <= FAR and tries[k] < most
        }
        too_many = len(failed) > len(levels) / 2
        if not which or (too_many and trouble(failed.values(), doubts=doubts)[1] > ALL_FAR):
            return inspection
        tries.update(which)

        # Add to the places `watched` of each level those that are near a limit on it and on its neighbours
        for level in inspection.levels[1:]:
            for near in (level.index - 1, level.index, level.index + 1):
                watched[near].append(level.measures.near_limits)

        folded = {k for k in which if failed[k].measures.self_intersections and k + 1 < len(levels)}
        watched_points = {k: np.vstack(some) for k, some in watched.items()}
        attempt, moved = maker.restore_limits(levels, which, folded, watched_points, follow=not doubts)
        inspection = _better_of(
            inspection, maker.onward(attempt), moved=moved, watched=watched, doubts=doubts, progress=progress
        )


def _better_of(
    before: Inspection,
    attempt: list[ndarray],
    moved: list[int],
    watched: defaultdict[int, list[ndarray]],
    doubts: bool,
    progress: Progress,
) -> Inspection:
    """The levels of an attempt, measured where they moved; runs of them that are no better are those `before`,
    and the places where they broke limits are added to `watched`."""
    count = len(before.control_points)
    fresh = range(count, len(attempt) + 1) if len(attempt) > count else ()
    cuts = sorted({*fresh, *(cut for k in moved for cut in (k, k + 1))})
    inspection = inspect_again(before, attempt, cuts, progress)
    for first, last in _runs(moved):
        after = last + 1 if last + 1 < count else len(attempt)
        now = inspection.levels[first : after + 1]
        then = before.levels[first : last + 2]
        if trouble(now, doubts=doubts) >= trouble(then, doubts=doubts):
            for level in now:
                watched[level.index].append(level.measures.near_limits)
            inspection = with_cuts_of(inspection, before, range(first, after + 1))
    return inspection


def restore_certificates(inspection: Inspection, maker: SequenceMaker, progress: Progress = silent) -> Inspection:
    """The levels with those moved that only their certificates doubt, and with one more below the stock where
    the last cut is too deep: the points that a sequence measures may miss what is left in a slit or a pit.

    The levels as they are where others than the last fail, where that breaks a measure, or takes another cut
    that no measure asked for.
    """
    last = inspection.levels[-1]
    others_failed = any(level is not last for level in inspection.failed)
    if others_failed or not (inspection.failed or inspection.uncertain):
        return inspection
    missed = _too_deep(inspection)
    try:
        again = restore_feasibility(inspection, maker, doubts=True, progress=progress)
        if _too_deep(again):
            count = len(again.control_points)
            longer = maker.onward(again.control_points, count + 1)
            again = inspect_again(again, longer, range(count, len(longer) + 1), progress)
    except LevelError:
        return inspection
    more_cuts = len(again.levels) > len(inspection.levels)
    return inspection if again.failed or (more_cuts and not missed) else again


def _too_deep(inspection: Inspection) -> bool:
    """Whether the last cut is out of tolerance, or may be by more than ACCEPTED."""
    last = inspection.levels[-1]
    return last in inspection.failed or excess_bound(last) > ACCEPTED


def _runs(numbers: Sequence[int]) -> list[tuple[int, int]]:
    """First and last of the numbers that follow each other; they rise."""
    firsts, lasts = ([k for k in numbers if k + step not in numbers] for step in (-1, 1))
    return list(zip(firsts, lasts))
