"""Sequences of levels, each from the one before, up to the last below the stock; none is measured here
(`inspection.py`)."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import LevelError, place_name
from bonecam.levels.problem.cut import Cut, Manner
from bonecam.levels.problem.discretisation import Setting
from bonecam.levels.problem.remaining import Remaining, remaining
from bonecam.levels.solvers.exchange import MENDABLE, Step, kept_level, next_level
from bonecam.progress import Progress, report
from bonecam.setup.schedule import Schedule
from bonecam.surface.query.closest_point import rings

VARIANTS = (
    (3e-7, 1e-4, 1.0, 2.0, 3.0),
    (1e-6, 1e-4, 1.0, 2.0, 0.05),
    (3e-7, 1e-4, 0.7, 2.0, 0.05),
    (3e-7, 1e-4, 0.3, 2.0, 0.05),
    (3e-7, 1e-4, 1.0, 2.0, 0.05),
    (3e-6, 1e-4, 0.7, 2.0, 0.05),
    (1e-5, 1e-4, 0.7, 2.0, 0.05),
    (1e-7, 1e-4, 0.5, 2.0, 0.05),
    (1e-6, 1e-3, 1.0, 2.0, 0.05),
)
"""Bending, smoothing of the field of directions, haste, how far beyond is pulled and how evenly (`Manner`);
tried in turn. The first gets the deepest cuts; what keeps creases sharp enough for that may break limits,
where the others do not. The third has less haste and the fourth little: places come to the stock together,
hollows stay wide, and broad parts get levels where those of the others fold."""
LAST, LATE = 3, 0.5
"""Where there are more cuts than K_min, the last so many levels below the stock are made again with this
haste at most: what is left is wider and shallower then, and the last levels can follow it."""
SPARE = (0, 0, 0.2, 0.2, 0.2, np.inf, np.inf, np.inf, np.inf)
"""How many cuts beyond K_min, as a share of it, a sequence may have to be measured once so many were tried;
one cut from the second on."""
STILL = 1e-6
"""Levels stay that would be mended by moves of control points that are less (mm)."""
STALL, SOFTEN, PATIENCE, MOST_EXTRA = 0.25, 0.1, 4, 5
MENDED = -0.5
"""Share of the limits' margins that mended levels keep: those above follow less and less, where with all of
it they follow all the way, and farther and farther along the level."""
RESCUES = 3
"""Levels of a sequence that may be made in other manners because they break their limits."""
EASINGS, EASED = 6, 0.3
"""How often the pull on a place that folds or breaks its limits is eased, each time to this share."""
CREASED, AROUND = 0.05, 1.0
"""Bends of the part with a smaller radius (mm) are edges that its mesh has, if they are so near (mm) to where
levels break their limits."""
LANDING, CREEP, MOST_CREEP = 0.03, 0.004, 0.49
"""How far inside the stock (mm) the last level stays; how much more each level before it, and how much more
the first at most. Where large parts take more levels than K_min those creep as well. Levels at the wall that
had no room would break their limits; levels that creep more stay farther from the wall and use less of their
depth: with 0.01 mm in capsules 0.001 to 0.002 less."""


@dataclass(frozen=True, eq=False)
class Sequences:
    """Makes sequences of levels: lists of control points, the part's first. `around` is the stock, from which
    nothing was measured yet; `lower_bound`: the fewest cuts with depths kept both ways."""

    setting: Setting
    around: Remaining
    schedule: Schedule
    lower_bound: int
    progress: Progress
    solver: str
    stiffness: float

    def all(self, rest: Remaining) -> Iterator[list[ndarray]]:
        """Sequences to be measured, the shortest known first, of two as short the one with more haste, whose
        cuts are deeper.

        LevelError where there is none.
        """
        waiting: list[tuple[Manner, list[ndarray]]] = []
        failure: LevelError | None = None
        yielded, why = False, ""
        for place, (variant, spare) in enumerate(zip(VARIANTS, SPARE, strict=True)):
            manner = _manner(self.stiffness, *variant)
            if why:
                report(self.progress, 0.0, f"levels in another manner, because {why}")
            try:
                waiting.append((manner, made := self.sequence(manner, rest)))
                why = f"these are {len(made)} cuts, and {self.lower_bound} may do"
            except LevelError as error:
                failure, why = failure or error, str(error).partition(": ")[0]
            waiting.sort(key=lambda one: (len(one[1]), -one[0].haste))
            most = self.lower_bound + max(place > 0, spare * self.lower_bound)
            while waiting and len(waiting[0][1]) <= most:
                yielded = True
                yield waiting.pop(0)[1]
                why = "those do not pass as measured"
        if failure is not None and not yielded:
            raise failure

    def sequence(self, manner: Manner, rest: Remaining) -> list[ndarray]:
        """Levels 0, 1, 2, ... up to the last below the stock. LevelError where progress ends."""
        made, rests = self._outwards([np.array(self.setting.surface.control_points)], [rest], manner)
        kept = self.lower_bound - LAST
        if len(made) > self.lower_bound and kept > 0:
            patient = replace(manner, late=min(manner.haste, LATE))
            again, _ = self._outwards(made[:kept], rests[:kept], patient)
            if len(again) < len(made):
                return again
        return made

    def _outwards(
        self, made: list[ndarray], rests: list[Remaining], manner: Manner, least: int = 0
    ) -> tuple[list[ndarray], list[Remaining]]:
        """The levels made already and those above them, so many at least, and what is left to the stock from
        each."""
        made, rests, stalls, rescued, limit, softened = [*made], [*rests], 0, 0, self.schedule.limit, manner
        while len(made) < least or rests[-1].left > limit(len(made)):
            k, before = len(made), rests[-1]
            report(self.progress, min(1.0, k / self.lower_bound), f"level {k}")
            step = self._next(made[-1], k, before, softened)
            if step.broken > MENDABLE:
                if (rescued := rescued + 1) > RESCUES:
                    raise self._broken(k, step)
                step = self._sound(made[-1], k, before, softened)
            made.append(made[-1] + step.moves)
            rests.append(rest := remaining(self.setting, made[-1], before))
            stalled = rest.left > before.left - STALL * limit(k)
            stalls, softened = (stalls + 1, _softer(softened)) if stalled else (0, softened)
            if stalls > PATIENCE or k >= self.lower_bound + self._most_extra:
                raise LevelError(
                    f"level {k} gets no nearer to the stock than {rest.left:.3f} mm at {place_name(rest.place)}: give more control points",
                    level=k,
                    place=rest.place,
                )
        return made, rests

    def _sound(self, P: ndarray, k: int, rest: Remaining, manner: Manner) -> Step:
        """The step from P to level k in the first of the other manners in which it keeps its limits.
        LevelError where there is none."""
        tried: list[Step] = []
        for other in (_manner(manner.stiffness, *variant) for variant in VARIANTS):
            if other != manner:
                tried.append(step := self._next(P, k, rest, other))
                if step.broken <= MENDABLE:
                    return step
        raise self._broken(k, min(tried, key=lambda step: step.broken))

    def mended(
        self,
        made: Sequence[ndarray],
        which: Collection[int],
        folded: Collection[int],
        watched: Mapping[int, ndarray],
        *,
        follow: bool = True,
    ) -> tuple[list[ndarray], list[int]]:
        """The same with some levels moved as little as keeps their limits, and which moved.

        Where levels `follow`, those above them that then break theirs do too.
        The `folded` ones start midway between those below and above. `watched` are parameters (s, t) of more
        places of each level on which its limits are watched.
        """
        made, moved = list(made), list[int]()
        for k in range(1, len(made)):
            if k in which or (follow and k - 1 in moved):
                report(self.progress, min(1.0, k / self.lower_bound), f"level {k} again")
                setting, cut = self.setting.watching(watched[k]), replace(self.cut(k), margin=MENDED)
                step = kept_level(
                    setting, made[k - 1], (made[k - 1] + made[k + 1]) / 2 if k in folded else made[k], cut
                )
                level = made[k - 1] + step.moves
                if step.broken <= MENDABLE and np.abs(level - made[k]).max() > STILL:
                    made[k] = level
                    moved.append(k)
        return made, moved

    def onward(self, made: list[ndarray], least: int = 0) -> list[ndarray]:
        """The same, so many levels at least, and those that are needed above the last where mending took that
        farther from the stock."""
        rest = remaining(self.setting, made[-1], self.around)
        return self._outwards(made, [rest], _manner(self.stiffness, *VARIANTS[0]), least)[0]

    def cut(self, k: int, left: float = 0.0) -> Cut:
        """Cut k as the program of level k sees it, where so much is `left` to the stock at most, mm."""
        longest = self.lower_bound - 1 + self._most_extra - MOST_EXTRA
        creep = min(CREEP, MOST_CREEP / max(longest, 1)) * max(0, longest - k)
        on_schedule = sum(self.schedule.limit(later) for later in range(k, max(k, self.lower_bound) + 1))
        return Cut(self.schedule.limit(k), max(on_schedule, left), LANDING + creep)

    def _broken(self, k: int, step: Step) -> LevelError:
        what, radius = (
            f"level {k} breaks its limits by {step.broken:.2f} mm at {place_name(step.place)}",
            self._sharpest(step.place),
        )
        remedy = "give more control points or a larger stock"
        if radius < CREASED:
            what += f", where the part's surface bends with a radius of {radius:.3f} mm"
            remedy = "raise surface.tolerance, or smooth the mesh"
        return LevelError(f"{what}: {remedy}", level=k, place=step.place)

    def _sharpest(self, place: ndarray) -> float:
        """The least radius of curvature (mm) of the part where it is nearest to a place."""
        part, watch = self.setting.surface, self.setting.watch
        away = lengths(watch.R @ part.control_points - place)
        near = np.flatnonzero(away < away.min() + AROUND)
        bends = part.curvature(watch.s[near], np.clip(watch.t[near], *rings(part)))
        return float(1 / max(np.abs(bends.k1).max(), np.abs(bends.k2).max(), np.finfo(float).tiny))

    @property
    def _most_extra(self) -> int:
        """How many levels more than K_min a sequence may have."""
        return max(MOST_EXTRA, self.lower_bound // 3)

    def _next(self, P: ndarray, k: int, rest: Remaining, manner: Manner) -> Step:
        """The step from P to level k; where it folds or breaks its limits the pull is eased (if it still
        does, the check decides)."""
        cut = self.cut(k, rest.left)
        if k >= self.lower_bound - LAST:
            manner = replace(manner, haste=manner.late)
        ease, tried = np.ones(len(P)), []
        for _ in range(EASINGS):
            tried.append(step := next_level(self.setting, P, rest, cut, manner, ease, self.solver))
            if not step.amiss.any():
                break
            ease[step.amiss] *= EASED
        return min(tried, key=lambda step: int(step.amiss.sum()))


def _softer(manner: Manner) -> Manner:
    return replace(manner, stiffness=SOFTEN * manner.stiffness, bending=SOFTEN * manner.bending)


def _manner(
    stiffness: float, bending: float, smoothing: float, haste: float, beyond: float, even: float
) -> Manner:
    return Manner(stiffness, bending, smoothing, haste, haste, beyond, even)
