"""A sequence of levels as measured: every cut a `Level` with its measures, and what failed where.

When some levels are mended only the cuts below and above them are measured again, on the same grid: such
levels move by microns.
"""

import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError, SurfaceError
from bonecam.levels.measure.certificate import certifiable, certificate, certificate_of_last
from bonecam.levels.measure.check import Measure, measure, require
from bonecam.levels.measure.grid import level_grid
from bonecam.levels.measure.level import Level
from bonecam.levels.measure.measured_surface import Sheet
from bonecam.levels.problem.tolerances import NEST_TOLERANCE
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report
from bonecam.setup.schedule import Schedule
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline
from bonecam.threads import cores

FEW = 100
"""So many places of a level that may be too deep are watched when it is mended."""


@dataclass(frozen=True, eq=False)
class Cut:
    """One cut as measured; `error` where a measure is out of tolerance."""

    level: Level
    found: Measure
    error: LevelError | None

    @property
    def measured(self) -> float:
        """How far the worst place measured breaks depth, nesting or stock, mm (negative where none does)."""
        return max(self.level.deepest - self.level.limit, -self.found.nesting_min, self.found.outside)

    @property
    def over(self) -> float:
        """The same between the places measured too."""
        sure = self.level.certificate
        return (
            self.measured
            if sure is None
            else max(self.measured, sure.depth - self.level.limit, -sure.gap, sure.outside)
        )

    @property
    def uncertain(self) -> bool:
        """Whether it may break a limit between the points measured."""
        return self.level.certified is False


@dataclass(frozen=True, eq=False)
class Rules:
    """What levels are measured against: the stock, the depths, how far (mm) they may fall behind and leave
    the stock."""

    stock: Stock
    schedule: Schedule
    behind: float
    outside: float
    chord_tolerance: float


class Inspection:
    """The levels `made` (control points of levels 0 to K - 1) as measured, in `seconds`. LevelError where one
    is creased."""

    def __init__(
        self, surface: TSpline, made: Sequence[Float[ndarray, "c 3"]], rules: Rules, progress: Progress
    ) -> None:
        began = time.perf_counter()
        try:
            self._grid = level_grid(surface, made, rules.chord_tolerance)
        except SurfaceError as error:
            raise LevelError(f"a level is creased: {error}") from error
        part = Sheet(surface, self._grid)
        self._part = Level(0, surface, part.mesh, 0.0, 0.0, 0.0, 0.0, len(self_intersections(part.mesh)))
        self._surface, self._rules, self._progress = surface, rules, progress
        self._cuts: dict[int, Cut] = {}
        self.seconds = time.perf_counter() - began
        self.measure(made, range(1, len(made) + 1))

    def measure(self, made: Sequence[Float[ndarray, "c 3"]], cuts: Iterable[int]) -> None:
        """Measure some of the cuts, again where they have been."""
        began = time.perf_counter()
        cuts, threads, sheets = list(cuts), cores(), dict[int, Sheet]()
        with ThreadPoolExecutor(threads) as pool:
            for some in (cuts[first : first + threads] for first in range(0, len(cuts), threads)):
                report(self._progress, some[0] / (len(made) + 1), f"checking level {some[0]}")
                needed = {j for k in some for j in (k - 1, k) if j < len(made)}
                sheets = {
                    j: sheets.get(j) or Sheet(self._surface.with_control_points(made[j]), self._grid)
                    for j in needed
                }
                measured = pool.map(lambda k, at=sheets: self._cut(k, at[k - 1], at.get(k)), some)
                self._cuts.update(zip(some, measured))
        self.seconds += time.perf_counter() - began

    def copy(self) -> "Inspection":
        """The same measures, to be taken again on other levels."""
        other = copy(self)
        other._cuts = dict(self._cuts)
        return other

    def trouble(self, cuts: Iterable[int], doubts: bool) -> tuple[int, float]:
        """How many faces of the levels of these cuts cut others, and how far the worst place measured breaks
        a limit, mm; with `doubts` the worst that the certificates leave open."""
        some = [self._cuts[k] for k in cuts]
        return sum(cut.level.self_intersections for cut in some), max(
            cut.over if doubts else cut.measured for cut in some
        )

    def restore(self, other: "Inspection", cuts: Iterable[int]) -> None:
        """Take these cuts as the other inspection has them."""
        for k in cuts:
            self._cuts.pop(k)
            if k in other._cuts:
                self._cuts[k] = other._cuts[k]

    @property
    def levels(self) -> tuple[Level, ...]:
        """Levels 0 (the part) to K (the stock)."""
        return (self._part, *(self._cuts[k].level for k in sorted(self._cuts)))

    @property
    def nets(self) -> list[ndarray]:
        """Control points of levels 0 to K - 1."""
        return [level.surface.control_points for level in self.levels if level.surface is not None]

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """Cuts 1 to K."""
        return tuple(self._cuts[k] for k in sorted(self._cuts))

    @property
    def crosses(self) -> bool:
        """Whether a level cuts itself."""
        return any(level.self_intersections for level in self.levels)

    @property
    def failed(self) -> tuple[Cut, ...]:
        """Those out of tolerance."""
        return tuple(cut for cut in self.cuts if cut.error is not None)

    @property
    def uncertain(self) -> tuple[Cut, ...]:
        """Those that measure well and yet may be out of tolerance between the points."""
        return tuple(cut for cut in self.cuts if cut.error is None and cut.uncertain)

    def _cut(self, k: int, inner: Sheet, outer: Sheet | None) -> Cut:
        stock, limit = self._rules.stock, self._rules.schedule.limit(k)
        mesh = stock.mesh(self._rules.chord_tolerance) if outer is None else outer.mesh
        found, error = measure(inner, outer or mesh, stock, limit), None
        try:
            require(k, found, limit, mesh, self._rules.behind, self._rules.outside)
        except LevelError as failure:
            error = failure
        level = _level(k, None if outer is None else outer.surface, mesh, limit, found)
        if not certifiable(inner.surface) or self._rules.behind > NEST_TOLERANCE:
            return Cut(level, found, error)
        if outer is None:
            return Cut(
                replace(level, certificate=certificate_of_last(inner.surface, stock, limit)), found, error
            )
        sure = certificate(inner.surface, outer.surface, stock, limit)
        doubted = sure.too_deep[:FEW]
        if sure.gap < -NEST_TOLERANCE:
            doubted = np.vstack([doubted, outer.surface.project(sure.hindmost[None]).parameters])
        found = replace(found, near_limits=np.vstack([found.near_limits, doubted]))
        return Cut(replace(level, certificate=sure), found, error)


def _level(k: int, surface: TSpline | None, mesh: TriangleMesh, limit: float, found: Measure) -> Level:
    return Level(
        k,
        surface,
        mesh,
        limit,
        found.depth_max,
        found.depth_mean,
        found.nesting_min,
        found.self_intersections,
        found.depth_max_back,
        found.full_mean,
        found.outside,
        tuple(float(v) for v in found.histogram),
        full_area=found.full_area,
    )
