"""Sequences of levels, each from the one before, up to the last below the stock; none is measured here
(`inspection.py`)."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray

from bonecam.arrays import lengths, settled
from bonecam.errors import LevelError, place_name
from bonecam.levels.problem.cut import Cut, StepParameters
from bonecam.levels.problem.discretisation import Discretisation
from bonecam.levels.problem.remaining import Remaining, remaining
from bonecam.levels.sequences.loop import Stop, levels_to_stock
from bonecam.levels.solvers.exchange import LARGEST_VIOLATION, ExchangeStep, next_level, project_level
from bonecam.progress import Progress, report
from bonecam.setup.schedule import Schedule
from bonecam.surface.query.closest_point import rings

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
