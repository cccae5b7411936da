"""A morph whose levels are made and not measured yet, and the morph: of several ways to make the levels the first
one counts that keeps its limits as measured."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

from numpy import ndarray

from bonecam.errors import LevelError, counted
from bonecam.levels.measure.inspection import Inspection, excess_bound
from bonecam.levels.measure.level import Level
from bonecam.levels.sequences.restore_feasibility import ACCEPTED, restore_certificates, restore_feasibility
from bonecam.levels.sequences.sequence_maker import SequenceMaker
from bonecam.setup.schedule import Schedule


@dataclass(frozen=True, eq=False)
class Morph:
    """Levels 0 (the part) to K (the stock), and K_min, the fewest cuts any sequence of these depths needs.

    K_min counts the largest distance between part and stock, from a point of either to the other, as the
    depths of the cuts are limited both ways. `distance` is that from the stock to the part, mm. The seconds
    are for benchmarks and reports. `breaks` is by how much (mm) a level exceeds its depth, falls behind or leaves the
    stock where no sequence keeps every tolerance, ACCEPTED at most but with the published program; else 0.
    """

    levels: tuple[Level, ...]
    lower_bound: int
    distance: float
    solve_seconds: float
    check_seconds: float
    breaks: float = 0.0

    def __repr__(self) -> str:
        return f"<Morph of {counted(self.cuts, 'cut')}, K_min {self.lower_bound}>"

    @cached_property
    def cuts(self) -> int:
        """K, the number of cuts."""
        return len(self.levels) - 1

    @cached_property
    def depth_used(self) -> float:
        """Mean share of the limit that the levels move where at least a full depth of material is left, over
        all their area."""
        cuts = self.levels[1:]
        whole = sum(level.measures.full_depth_area for level in cuts)
        used = sum(level.measures.full_depth_area * level.measures.full_depth_mean / level.limit for level in cuts)
        return used / whole if whole else 1.0


@dataclass(frozen=True, eq=False)
class BegunMorph:
    """The levels that a morph makes first, not measured yet: `first` holds the control points of levels 0 to K - 1.

    `distance` (mm) is the largest from the stock to the part, `apart` that either way, `rest` what the last cut has
    to take at most. Levels that break their limits by more than `accepted` (mm) are refused.
    """

    schedule: Schedule
    first: list[ndarray]
    others: Iterator[list[ndarray]]
    maker: SequenceMaker | None
    measure: Callable[[list[ndarray]], Inspection]
    distance: float
    apart: float
    rest: float
    seconds: float
    accepted: float = ACCEPTED

    def measured(self) -> Morph:
        """The morph: the first levels, or those of the next way to make them, that keep their limits as measured.
        LevelError where none do."""
        started = time.perf_counter()
        sequences = chain([self.first], self.others)
        inspection, checking = _first_within_limits(sequences, self.maker, self.measure, self.accepted)
        breaks = max((excess_bound(level) for level in inspection.failed), default=0.0)
        solving = self.seconds + time.perf_counter() - started - checking
        lower_bound = self.schedule.lower_bound(self.apart)
        return Morph(
            inspection.levels,
            lower_bound,
            distance=self.distance,
            solve_seconds=solving,
            check_seconds=checking,
            breaks=breaks,
        )


def _first_within_limits(
    sequences: Iterator[list[ndarray]],
    maker: SequenceMaker | None,
    measure: Callable[[list[ndarray]], Inspection],
    accepted: float,
) -> tuple[Inspection, float]:
    """The first sequence of which every cut keeps its limits as measured, and the seconds of all measuring;
    levels that do not are restored by `maker`, if there is one.

    Where there is none the first that exceeds its limits by `accepted` (mm) at most; else LevelError.
    """
    failure: LevelError | None = None
    nearly: Inspection | None = None
    checking = 0.0
    for levels in sequences:
        try:
            inspection = measure(levels)
            if maker is not None:
                inspection = restore_certificates(restore_feasibility(inspection, maker), maker)
        except LevelError as error:
            failure = failure or error
            continue
        checking += inspection.seconds
        try:
            inspection.require_passed()
        except LevelError as error:
            failure = failure or error
        else:
            return inspection, checking
        breaks = max(excess_bound(level) for level in inspection.failed)
        if nearly is None and not inspection.crosses and breaks <= accepted:
            nearly = inspection
    if nearly is None:
        assert failure is not None
        raise failure
    return nearly, checking
