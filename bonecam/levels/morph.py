"""The morph: from the part to the stock in as few levels as the depths allow (Gan et al. 2014, section 4.2).

Every level has the T-mesh and weights of the part; only control points change. Levels are made until every point of the
stock's surface lies within one depth of the last one; the stock itself is the level after that.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy import ndarray

from bonecam.errors import LevelError, SurfaceError, place_name
from bonecam.levels.attraction import ATTRACTIONS
from bonecam.levels.check import NEST_TOLERANCE, STOCK_TOLERANCE, Measure, measure, require
from bonecam.levels.grid import level_grid
from bonecam.levels.level import Level
from bonecam.levels.program import Cut, Manner
from bonecam.levels.remaining import Remaining, remaining, whole
from bonecam.levels.schedule import Schedule
from bonecam.levels.setting import Setting, setting_of
from bonecam.levels.sheet import Sheet
from bonecam.levels.step import next_level
from bonecam.levels.stock import MARGIN, Stock, require_inside
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, part, report, silent
from bonecam.surface.tspline import TSpline

METHODS = {"qp": (NEST_TOLERANCE, STOCK_TOLERANCE), "qcqp": (0.02, 2 * STOCK_TOLERANCE), "osqp": (NEST_TOLERANCE, STOCK_TOLERANCE)}
"""How far (mm) a level may fall behind the one before and leave the stock: the published program says nothing of the one, and holds
the other at samples only."""
VARIANTS, TRIED = ((1e-6, 1e-4, 1.0), (1e-6, 1e-4, 0.7), (3e-6, 1e-4, 0.7), (1e-7, 1e-4, 0.5), (1e-5, 1e-4, 0.7), (1e-6, 1e-3, 1.0)), 2
"""Bending, smoothing of the field of directions and haste (`Manner`); tried in turn."""
STIFFNESS, COARSE, STALL, SOFTEN, PATIENCE, MOST_EXTRA, MENDS = 5e-7, 0.02, 0.25, 0.1, 4, 12, 3
ACCEPTED = 0.01
"""Where no sequence keeps every tolerance, one that breaks depth, nesting or stock by no more (mm, the size of the
gouge tolerance) is taken. The report tells it."""
MOST_MENDED = 3000
"""Points near their limits that are watched when a level is made again; where there are more, another smoothing is tried."""
HARDER = (1.0, 10.0, 100.0, 1000.0)
"""Times the stiffness for a level that would fold."""
LANDING, CREEP = 0.03, 0.01
"""How far inside the stock (mm) the last level stays, and how much more each level before it."""


@dataclass(frozen=True, eq=False)
class Morph:
    """Levels 0 (the part) to K (the stock), and the fewest cuts K_min any schedule of these depths needs.

    `distance` is the largest distance from the stock to the part, mm. The seconds are for benchmarks and reports.
    """

    levels: tuple[Level, ...]
    lower_bound: int
    distance: float
    solve_seconds: float
    check_seconds: float

    @cached_property
    def cuts(self) -> int:
        """K, the number of cuts."""
        return len(self.levels) - 1

    @cached_property
    def depth_used(self) -> float:
        """Mean share of the limit that the levels move where at least a full depth of material is left, over all their area."""
        cuts = self.levels[1:]
        whole = sum(level.full_area for level in cuts)
        return sum(level.full_area * level.full_mean / level.limit for level in cuts) / whole if whole else 1.0


def morph(
    surface: TSpline,
    stock: Stock,
    schedule: Schedule,
    *,
    stiffness: float = STIFFNESS,
    attraction: str = "stock",
    method: str = "qp",
    chord_tolerance: float = 0.01,
    progress: Progress = silent,
) -> Morph:
    """All levels, measured on tessellations within `chord_tolerance` mm.

    `stiffness` is c_int / c_ext (parameters in [0, 1]); it falls where progress stalls. `method` is `qp`; `osqp`, the
    same programs solved by OSQP; or `qcqp`, the published program solved exactly (`levels/qcqp.py`): both slow, for reference.
    Raises StockError where the part is not inside the stock, LevelError where a level cannot be made or fails its check.
    """
    if attraction not in ATTRACTIONS:
        raise ValueError(f"attraction {attraction!r}: choose one of {', '.join(ATTRACTIONS)}")
    if method not in METHODS:
        raise ValueError(f"method {method!r}: choose one of {', '.join(METHODS)}")
    require_inside(stock, surface.tessellate(COARSE).vertices, MARGIN)
    start, checking = time.perf_counter(), 0.0
    setting = setting_of(surface, stock, ATTRACTIONS[attraction])
    rest = remaining(setting, surface.control_points, whole(stock))
    lower_bound = schedule.lower_bound(rest.left)
    solving, measuring = part(progress, 0.0, 0.7), part(progress, 0.7, 1.0)
    program = _Levels(setting, schedule, lower_bound, solving, method)
    sequences = (
        program.sequences(rest, stiffness) if method != "qcqp" else _by_cones(surface, stock, schedule, stiffness, attraction, solving)
    )
    failure: LevelError | None = None
    nearly: Morph | None = None
    for made, manner in sequences:
        for mends in range(MENDS + 1):
            began = time.perf_counter()
            levels, trouble = _measured(surface, made, stock, schedule, chord_tolerance, METHODS[method], measuring)
            checking += time.perf_counter() - began
            found = Morph(levels, lower_bound, rest.left, time.perf_counter() - start - checking, checking)
            if trouble is None:
                return found
            if nearly is None and not trouble.crosses and trouble.most <= ACCEPTED:
                nearly = found
            failure = failure or trouble.error
            if method == "qcqp" or mends == MENDS or trouble.crosses or not 0 < len(trouble.parameters) <= MOST_MENDED:
                break
            program = replace(program, setting=program.setting.watching(trouble.parameters))
            try:
                made = program.sequence(made[: trouble.level], manner)
            except LevelError:
                break  # the first failure is told, if no other sequence works
    if nearly is not None:
        return nearly
    assert failure is not None
    raise failure


def _by_cones(
    surface: TSpline, stock: Stock, schedule: Schedule, stiffness: float, attraction: str, progress: Progress
) -> Iterator[tuple[list[ndarray], Manner]]:
    """The one sequence of the published program."""
    from bonecam.levels.qcqp import cone_sequence

    grid, targets = level_grid(surface, [surface.control_points], COARSE), stock.mesh(COARSE).vertices

    def left(P: ndarray) -> tuple[float, ndarray]:
        distance = MeshDistance(grid.mesh(P)).unsigned(targets)
        return float(distance.max()), targets[np.argmax(distance)]

    yield cone_sequence(surface, stock, schedule, stiffness, attraction, left, progress), Manner(stiffness, stiffness, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class _Levels:
    """Makes sequences of levels."""

    setting: Setting
    schedule: Schedule
    lower_bound: int
    progress: Progress
    method: str

    def sequences(self, rest: Remaining, stiffness: float) -> Iterator[tuple[list[ndarray], Manner]]:
        """Sequences to be measured and how they were made; of the first TRIED the shortest first, and K_min cuts end the search."""
        waiting: list[tuple[list[ndarray], Manner]] = []
        failure: LevelError | None = None
        yielded = False
        for place, (bending, smoothing, haste) in enumerate(VARIANTS):
            manner = Manner(stiffness, bending, smoothing, haste)
            try:
                waiting.append((self.sequence([np.array(self.setting.surface.control_points)], manner, rest), manner))
            except LevelError as error:
                failure = failure or error
            waiting.sort(key=lambda one: len(one[0]))
            if waiting and (place + 1 >= TRIED or len(waiting[0][0]) <= self.lower_bound):
                yielded = True
                yield waiting.pop(0)
        yield from waiting
        if failure is not None and not yielded:
            raise failure

    def sequence(self, made: list[ndarray], manner: Manner, rest: Remaining | None = None) -> list[ndarray]:
        """Control points of levels 0, 1, 2, ... up to the last below the stock, from those `made`. LevelError where progress ends."""
        made, stalls, limit = list(made), 0, self.schedule.limit
        rest = rest or remaining(self.setting, made[-1], whole(self.setting.stock))
        while rest.left > limit(len(made)):
            k, before = len(made), rest.left
            report(self.progress, min(1.0, k / self.lower_bound), f"level {k}")
            left = sum(limit(later) for later in range(k, max(k, self.lower_bound) + 1))
            cut = Cut(limit(k), left, LANDING + CREEP * max(0, self.lower_bound - 1 - k))
            made.append(made[-1] + self._step(made[-1], rest, cut, manner))
            rest = remaining(self.setting, made[-1], rest)
            stalled = rest.left > before - STALL * cut.depth
            stalls, manner = (stalls + 1, _softer(manner)) if stalled else (0, manner)
            if stalls > PATIENCE or k >= self.lower_bound + MOST_EXTRA:
                raise LevelError(
                    f"level {k} gets no nearer to the stock than {rest.left:.3f} mm at {place_name(rest.place)}: give more control points",
                    level=k,
                    place=rest.place,
                )
        return made

    def _step(self, P: ndarray, rest: Remaining, cut: Cut, manner: Manner) -> ndarray:
        """The moves to the next level, stiffer where it would fold; the softest if all do (the check decides)."""
        steps = []
        for harder in HARDER:
            stiffer = replace(manner, stiffness=harder * manner.stiffness)
            steps.append(next_level(self.setting, P, rest, cut, stiffer, self.method))
            if not steps[-1].folded:
                return steps[-1].moves
        return steps[0].moves


def _softer(manner: Manner) -> Manner:
    return replace(manner, stiffness=SOFTEN * manner.stiffness, bending=SOFTEN * manner.bending)


@dataclass(frozen=True, eq=False)
class _Trouble:
    """The first failed check, its level, and the parameters of what was near the limits on all levels.

    `most` is how far (mm) the worst place breaks depth, nesting or stock.
    """

    error: LevelError
    level: int
    parameters: ndarray
    crosses: bool
    most: float


def _measured(
    surface: TSpline,
    made: Sequence[ndarray],
    stock: Stock,
    schedule: Schedule,
    chord_tolerance: float,
    tolerances: tuple[float, float],
    progress: Progress,
) -> tuple[tuple[Level, ...], _Trouble | None]:
    """The levels with what was measured on each, the stock behind them; and what failed."""
    try:
        grid = level_grid(surface, made, chord_tolerance)
    except SurfaceError as error:
        return (), _Trouble(LevelError(f"a level is creased: {error}"), 0, np.empty((0, 2)), True, np.inf)
    inner = Sheet(surface, grid)
    levels = [Level(0, surface, inner.mesh, 0.0, 0.0, 0.0, 0.0, len(self_intersections(inner.mesh)))]
    failed: list[LevelError] = []
    most = 0.0
    places: list[ndarray] = []
    for k in range(1, len(made) + 1):
        report(progress, k / (len(made) + 1), f"checking level {k}")
        outer = Sheet(surface.with_control_points(made[k]), grid) if k < len(made) else stock.mesh(chord_tolerance)
        shape, mesh = (outer.surface, outer.mesh) if isinstance(outer, Sheet) else (None, outer)
        found = measure(inner, outer, stock, schedule.limit(k))
        try:
            require(k, found, schedule.limit(k), mesh, *tolerances)
        except LevelError as error:
            failed.append(error)
            most = max(most, found.depth_max - schedule.limit(k), -found.nesting_min, found.outside)
        levels.append(_level(k, shape, mesh, schedule.limit(k), found))
        places.append(found.near_limits)
        inner = outer if isinstance(outer, Sheet) else inner
    if failed:
        return tuple(levels), _Trouble(
            failed[0], failed[0].evidence["level"], np.vstack(places), any(level.self_intersections for level in levels), most
        )
    return tuple(levels), None


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
