"""Sequences of levels from the part to the last one below the stock.

The loop that makes a sequence of levels, each from the one before, until less than one depth is left to the
stock. The closed morph, the published program and the morph of an open surface all go through it.

Sequences of levels, each from the one before, up to the last below the stock; none is measured here
(`measure.py`).

Levels that do not pass as measured: moved as little as keeps their limits.

(Levels midway between the two of a cut that falls behind were no better: where levels slide along the
surface, what lies midway dips between them, by 0.007 mm on a femur.)

A morph whose levels are made and not measured yet, and the morph: of several ways to make the levels the first
one counts that keeps its limits as measured.
"""

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths, settled
from bonecam.errors import LevelError, counted, place_name
from bonecam.job.levels_section import MOST_LEVELS
from bonecam.levels.measure import Inspection, Level, excess_bound, inspect_again, trouble
from bonecam.levels.problem import Cut, Discretisation, Remaining, StepParameters, remaining
from bonecam.levels.solvers.exchange import LARGEST_VIOLATION, ExchangeStep, next_level, project_level
from bonecam.progress import Progress, report, silent
from bonecam.setup.stock import Schedule
from bonecam.surface.query import rings

STALL = 0.25
"""A level stalls that brings the stock nearer by less than this share of its depth."""


@runtime_checkable
class Rest(Protocol):
    """What is left between a level and the stock."""

    @property
    def left(self) -> float:
        """The largest distance between the two, mm."""

    @property
    def place(self) -> Float[ndarray, "3"]:
        """Where that is."""


AnyLevel = TypeVar("AnyLevel")
AnyRest = TypeVar("AnyRest", bound=Rest)


@dataclass(frozen=True)
class Stop:
    """When a sequence ends that does not get to the stock: after more than `max_stalled` stalled levels in turn, or
    with level `most`; `remedy` ends the message."""

    remedy: str
    max_stalled: int = MOST_LEVELS
    most: int = MOST_LEVELS


def levels_to_stock(
    made: Sequence[AnyLevel],
    rest: AnyRest,
    schedule: Schedule,
    next_level: Callable[[AnyLevel, int, AnyRest], AnyLevel],
    rest_above: Callable[[AnyLevel, int, AnyRest], AnyRest],
    stop: Stop,
    progress: Progress,
    *,
    lower_bound: int,
    least: int = 0,
) -> list[AnyLevel]:
    """The levels `made` (0, 1, ...) and those above them, up to the last below the stock; `least` in all at least.

    `rest` is what is left above the last one made. `next_level` makes level k from the one before and what is left
    above that; `rest_above` measures what is left above level k. `lower_bound` is K_min, for the progress told.
    LevelError, with the number of the level, where one cannot be made or the sequence stops short of the stock.
    """
    levels = list(made)
    stalled = 0
    while len(levels) < least or rest.left > schedule.limit(len(levels)):
        k = len(levels)
        report(progress, min(1.0, k / lower_bound), f"level {k}")
        try:
            levels.append(next_level(levels[-1], k, rest))
        except LevelError as error:
            if "level" in error.evidence:
                raise
            raise LevelError(f"level {k}: {error}", level=k, **error.evidence) from error

        before = rest
        rest = rest_above(levels[-1], k, before)
        stalled = stalled + 1 if stalls(before, rest, schedule.limit(k)) else 0
        if stalled > stop.max_stalled or k >= stop.most:
            raise LevelError(
                f"level {k} gets no nearer to the stock than {rest.left:.3f} mm at "
                f"{place_name(rest.place)}: {stop.remedy}",
                level=k,
                place=rest.place,
            )
    return levels


def stalls(before: Rest, after: Rest, depth: float) -> bool:
    """Whether a level whose cut may be `depth` mm deep leaves nearly as much to the stock as the one before."""
    return after.left > before.left - STALL * depth


DEEP = {"bending": 3e-7, "uniform": 3.0}
STIFF = {"bending": 1e-6, "uniform": 0.05}
TOGETHER = {"bending": 3e-7, "uniform": 0.05, "least_share": 0.7}
"""Three ways to make levels (`StepParameters`). The first makes the deepest cuts: all samples pull alike, and the
surface bends easily. Where it takes more than K_min cuts or does not pass as measured the second, stiffer one is
tried, in which samples pull by their area: the levels of a talus pass only with it. Where neither gets to the stock
all places are led there together, so that hollows stay wide: a femur's end has no levels otherwise."""
STILL = 1e-6
"""A level stays as it is where no control point would move by more (mm) to restore its limits."""
MAX_STALLED = 4
"""So many levels in turn may stall."""
MOST_EXTRA = 5
"""So many more levels than K_min a sequence may have, or a third of K_min where that is more."""
RESTORED_MARGIN = -0.5
"""Share of the limits' margins that restored levels keep: those above follow less and less, where with all of it
they follow all the way, and farther and farther along the level."""
MAX_REDUCTIONS, REDUCTION = 6, 0.3
"""How often the pull is reduced where a level folds or breaks its limits, each time to this share. (Without it the
levels of a scaphoid use 0.57 of their depth instead of 0.96, and take 2.3 times as long.)"""
CREASED, AROUND = 0.05, 1.0
"""Bends of the part with a smaller radius (mm) are edges that its mesh has, if they are so near (mm) to where
levels break their limits."""
LANDING = 0.03
"""How far inside the stock the last level stays, mm."""
CREEP, MOST_CREEP = 0.004, 0.49
"""How much farther inside each level stays than the next, mm, and the first than the last at most: levels that met
at the wall would have no room for their limits: without it a third metacarpal loses 3 of 17 certificates."""


@dataclass(frozen=True, eq=False)
class SequenceMaker:
    """Makes sequences of levels: lists of control points, the part's first.

    `around` is the stock, from which nothing was measured yet; `lower_bound` is K_min, the fewest cuts with depths
    kept both ways; `solver` is one of `SOLVERS`; `stiffness` is c_int / c_ext.
    """

    discretisation: Discretisation
    around: Remaining
    schedule: Schedule
    lower_bound: int
    progress: Progress
    solver: str
    stiffness: float

    def all(self, rest: Remaining) -> Iterator[list[ndarray]]:
        """Sequences to be measured, with DEEP and with STIFF parameters: one of K_min cuts as it is made, the other
        when both are, the shorter first. Then one with TOGETHER parameters.

        LevelError where there is none.
        """
        sequences: list[list[ndarray]] = []
        failure: LevelError | None = None
        for parameters in (self._parameters(DEEP), self._parameters(STIFF)):
            try:
                levels = self.sequence(parameters, rest)
            except LevelError as error:
                failure = failure or error
                continue
            sequences.append(levels)
            if len(levels) <= self.lower_bound:
                yield levels
        yield from sorted((levels for levels in sequences if len(levels) > self.lower_bound), key=len)
        try:
            yield self.sequence(self._parameters(TOGETHER), rest)
        except LevelError as error:
            if not sequences:
                raise failure or error from error

    def _parameters(self, values: dict[str, float]) -> StepParameters:
        """The parameters of a way to make levels, with the stiffness that was asked for."""
        return StepParameters(self.stiffness, **values)

    def sequence(self, parameters: StepParameters, rest: Remaining) -> list[ndarray]:
        """Levels 0, 1, 2, ... up to the last below the stock. LevelError where progress ends."""
        return self._continue([np.array(self.discretisation.surface.control_points)], rest, parameters)

    def _continue(
        self, levels: list[ndarray], rest: Remaining, parameters: StepParameters, least: int = 0
    ) -> list[ndarray]:
        """The levels made already, from the last of which `rest` is left to the stock, and those above them:
        so many in all at least."""
        return levels_to_stock(
            levels,
            rest,
            schedule=self.schedule,
            next_level=lambda P, k, rest: self._next(P, k, rest, parameters),
            rest_above=lambda P, k, before: remaining(self.discretisation, P, before),
            stop=Stop("give more control points", MAX_STALLED, self.lower_bound + self._most_extra),
            progress=self.progress,
            lower_bound=self.lower_bound,
            least=least,
        )

    def restore_limits(
        self,
        made: Sequence[ndarray],
        which: Collection[int],
        folded: Collection[int],
        watched: Mapping[int, ndarray],
        *,
        follow: bool = True,
    ) -> tuple[list[ndarray], list[int]]:
        """All levels, those of `which` moved as little as keeps their limits, and the numbers of those that moved.

        Where levels `follow`, those above them that then break their limits move too. The `folded` ones start
        midway between the levels below and above. `watched` are parameters (s, t) of more places of each level on
        which its limits are watched.
        """
        made = list(made)
        moved: list[int] = []
        for k in range(1, len(made)):
            if k in which or (follow and k - 1 in moved):
                report(self.progress, min(1.0, k / self.lower_bound), f"level {k} again")
                discretisation = self.discretisation.also_watching(watched[k])
                cut = replace(self.cut(k), margin=RESTORED_MARGIN)
                start = (made[k - 1] + made[k + 1]) / 2 if k in folded else made[k]
                step = project_level(discretisation, made[k - 1], start, cut)
                level = settled(made[k - 1] + step.moves)
                if step.broken <= LARGEST_VIOLATION and np.abs(level - made[k]).max() > STILL:
                    made[k] = level
                    moved.append(k)
        return made, moved

    def onward(self, made: list[ndarray], least: int = 0) -> list[ndarray]:
        """The levels made already and those that are needed above them, so many in all at least: to restore limits
        may take the last one farther from the stock."""
        rest = remaining(self.discretisation, made[-1], self.around)
        return self._continue(made, rest, self._parameters(DEEP), least)

    def cut(self, k: int) -> Cut:
        """Cut k as the program of level k sees it."""
        longest = self.lower_bound - 1 + self._most_extra - MOST_EXTRA
        creep = min(CREEP, MOST_CREEP / max(longest, 1)) * max(0, longest - k)
        return Cut(self.schedule.limit(k), LANDING + creep)

    def _broken(self, k: int, step: ExchangeStep) -> LevelError:
        """The error of a level that breaks its limits, with the sharp edge of the part that may be why."""
        what = f"level {k} breaks its limits by {step.broken:.2f} mm at {place_name(step.place)}"

        # The least radius of curvature (mm) of the part where it is nearest to a place
        part, watch = self.discretisation.surface, self.discretisation.watch
        away = lengths(watch.R @ part.control_points - step.place)
        near = np.flatnonzero(away < away.min() + AROUND)
        bends = part.curvature(watch.s[near], np.clip(watch.t[near], *rings(part)))
        radius = float(1 / max(np.abs(bends.k1).max(), np.abs(bends.k2).max(), np.finfo(float).tiny))

        remedy = "give more control points or a larger stock"
        if radius < CREASED:
            what += f", where the part's surface bends with a radius of {radius:.3f} mm"
            remedy = "raise surface.tolerance, or smooth the mesh"
        return LevelError(f"{what}: {remedy}", level=k, place=step.place)

    @property
    def _most_extra(self) -> int:
        """How many levels more than K_min a sequence may have."""
        return max(MOST_EXTRA, self.lower_bound // 3)

    def _next(self, P: ndarray, k: int, rest: Remaining, parameters: StepParameters) -> ndarray:
        """Level k above the one with control points P; where it folds or breaks its limits the pull is reduced (if
        it still does, the check decides). LevelError where it breaks a limit by more than LARGEST_VIOLATION."""
        cut = self.cut(k)
        pull_factor = np.ones(len(P))
        tried: list[ExchangeStep] = []
        for _ in range(MAX_REDUCTIONS):
            step = next_level(
                self.discretisation,
                P,
                rest=rest,
                cut=cut,
                parameters=parameters,
                pull_factor=pull_factor,
                solver=self.solver,
            )
            tried.append(step)
            if not step.infeasible.any():
                break
            pull_factor[step.infeasible] *= REDUCTION
        step = min(tried, key=lambda step: int(step.infeasible.sum()))
        if step.broken > LARGEST_VIOLATION:
            raise self._broken(k, step)
        return settled(P + step.moves)


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
            cuts_before = [level for level in before.levels if first <= level.index <= after]
            others = [level for level in inspection.levels if not first <= level.index <= after]
            levels = sorted(others + cuts_before, key=lambda level: level.index)
            inspection = replace(inspection, levels=tuple(levels))
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
        """The morph: the first levels, or those of the next way to make them, of which every cut keeps its limits as
        measured; levels that do not are restored by the `maker`, if there is one. Where there are none the first that
        exceed their limits by what is `accepted` at most; else LevelError."""
        started = time.perf_counter()
        failure: LevelError | None = None
        nearly: Inspection | None = None
        checking = 0.0
        for levels in chain([self.first], self.others):
            try:
                inspection = self.measure(levels)
                if self.maker is not None:
                    inspection = restore_certificates(restore_feasibility(inspection, self.maker), self.maker)
            except LevelError as error:
                failure = failure or error
                continue
            checking += inspection.seconds
            try:
                inspection.require_passed()
            except LevelError as error:
                failure = failure or error
            else:
                break
            breaks = max(excess_bound(level) for level in inspection.failed)
            if nearly is None and not inspection.crosses and breaks <= self.accepted:
                nearly = inspection
        else:
            if nearly is None:
                assert failure is not None
                raise failure
            inspection = nearly
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
