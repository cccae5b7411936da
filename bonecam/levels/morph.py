"""The morph: from the part to the stock in as few levels as the depths allow (Gan et al. 2014, section 4.2).

Every level has the T-mesh and weights of the part; only control points change. Levels are made until every point of the
stock's surface lies within one depth of the last one; the stock itself is the level after that.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy import ndarray

from bonecam.errors import LevelError
from bonecam.levels.attraction import ATTRACTIONS
from bonecam.levels.check import NEST_TOLERANCE, measure, require
from bonecam.levels.grid import LevelGrid, level_grid
from bonecam.levels.level import Level
from bonecam.levels.schedule import MOST_LEVELS, Schedule
from bonecam.levels.setting import Setting, setting_of
from bonecam.levels.step import next_level
from bonecam.levels.stock import MARGIN, Stock, require_inside
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, part, report, silent
from bonecam.surface.tspline import TSpline

METHODS = {"qp": NEST_TOLERANCE, "qcqp": 0.02}
"""How far (mm) a level may fall behind the one before: the published program says nothing of it, and holds it at samples only."""
SMOOTHINGS, TRIED = (1e-6, 1e-5, 1e-4), 2
STIFFNESS, COARSE, STALL, SOFTEN, PATIENCE = 1e-7, 0.02, 0.25, 0.1, 4


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

    `stiffness` is c_int / c_ext (parameters in [0, 1]); it falls where progress stalls. `method` is `qp` or `qcqp`, the published
    program solved exactly (`levels/qcqp.py`: slow, the reference). Raises StockError where the part
    is not inside the stock, LevelError where a level cannot be made or fails its check.
    """
    if attraction not in ATTRACTIONS:
        raise ValueError(f"attraction {attraction!r}: choose one of {', '.join(ATTRACTIONS)}")
    if method not in METHODS:
        raise ValueError(f"method {method!r}: choose one of {', '.join(METHODS)}")
    coarse = level_grid(surface, [surface.control_points], COARSE)
    require_inside(stock, coarse.mesh(surface.control_points).vertices, MARGIN)
    start = time.perf_counter()
    distance = _distance(stock, coarse.mesh(surface.control_points))[0]
    lower_bound = schedule.lower_bound(distance)
    solving = part(progress, 0.0, 0.7)
    if method == "qcqp":
        from bonecam.levels.qcqp import cone_sequence

        made = cone_sequence(surface, stock, schedule, stiffness, attraction, lambda P: _distance(stock, coarse.mesh(P)), solving)
    else:
        made = _fewest(surface, stock, schedule, stiffness, attraction, coarse, lower_bound, solving)
    solved = time.perf_counter()
    levels = _measured(surface, made, stock, schedule, chord_tolerance, METHODS[method], part(progress, 0.7, 1.0))
    return Morph(levels, lower_bound, distance, solved - start, time.perf_counter() - solved)


def _distance(stock: Stock, mesh: TriangleMesh) -> tuple[float, ndarray]:
    """The largest distance from the stock to the mesh, mm, and where."""
    targets = stock.mesh(COARSE).vertices
    distance = MeshDistance(mesh).unsigned(targets)
    return float(distance.max()), targets[np.argmax(distance)]


def _fewest(
    surface: TSpline,
    stock: Stock,
    schedule: Schedule,
    stiffness: float,
    attraction: str,
    coarse: LevelGrid,
    lower_bound: int,
    progress: Progress,
) -> list[ndarray]:
    """The shortest sound sequence of the first smoothings (or the first later one that works); K_min cuts end the search."""
    best: list[ndarray] | None = None
    failure: LevelError | None = None
    for place, smoothing in enumerate(SMOOTHINGS):
        steps = part(progress, place / len(SMOOTHINGS), (place + 1) / len(SMOOTHINGS))
        setting = setting_of(surface, stock, ATTRACTIONS[attraction], smoothing)
        most = MOST_LEVELS if best is None else len(best) - 1
        try:
            made = _sequence(setting, np.array(surface.control_points), schedule, stiffness, coarse, lower_bound, most, steps)
        except LevelError as error:
            failure = failure or error
            continue
        if best is None or len(made) < len(best):
            best = made
        if len(best) <= lower_bound or place + 1 >= TRIED:
            break
    if best is None:
        assert failure is not None
        raise failure
    return best


def _sequence(
    setting: Setting,
    P: ndarray,
    schedule: Schedule,
    stiffness: float,
    coarse: LevelGrid,
    lower_bound: int,
    most: int,
    progress: Progress,
) -> list[ndarray]:
    """Control points of levels 0, 1, 2, ... up to the last below the stock. LevelError where progress ends, or after `most` levels."""
    left, _ = _distance(setting.stock, coarse.mesh(P))
    allowance, stalls, made = np.ones(len(P)), 0, [P]
    while left > schedule.limit(len(made)):
        k = len(made)
        depth = schedule.limit(k)
        report(progress, min(1.0, k / lower_bound), f"level {k}")
        step = next_level(setting, made[-1], depth, stiffness, allowance)
        allowance = step.allowance
        made.append(made[-1] + step.moves)
        mesh = coarse.mesh(made[-1])
        before, (left, place) = left, _distance(setting.stock, mesh)
        stalled = left > before - STALL * depth
        stalls, stiffness = (stalls + 1, stiffness * SOFTEN) if stalled else (0, stiffness)
        where = f"({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f})"
        if stalls > PATIENCE or k >= most:
            raise LevelError(
                f"level {k} gets no nearer to the stock than {left:.3f} mm at {where}: give more control points", level=k, place=place
            )
        if len(self_intersections(mesh)):
            raise LevelError(f"level {k} cuts itself: give a higher stiffness or more control points", level=k, place=place)
    return made


def _measured(
    surface: TSpline,
    made: Sequence[ndarray],
    stock: Stock,
    schedule: Schedule,
    chord_tolerance: float,
    behind: float,
    progress: Progress,
) -> tuple[Level, ...]:
    """The levels with what was measured on each; the stock behind them."""
    grid = level_grid(surface, made, chord_tolerance)
    meshes = [grid.mesh(P) for P in made] + [stock.mesh(chord_tolerance)]
    first = len(self_intersections(meshes[0]))
    levels = [Level(0, surface, meshes[0], 0.0, 0.0, 0.0, 0.0, first)]
    for k in range(1, len(meshes)):
        report(progress, k / len(meshes), f"checking level {k}")
        last = k == len(made)
        shape = None if last else surface.with_control_points(made[k])
        levels.append(_level(k, shape, meshes[k - 1], meshes[k], stock, schedule.limit(k), behind))
    return tuple(levels)


def _level(k: int, surface: TSpline | None, inner: TriangleMesh, outer: TriangleMesh, stock: Stock, limit: float, behind: float) -> Level:
    found = measure(inner, outer, stock, limit, surface is None)
    require(k, found, limit, inner, outer, stock, behind)
    return Level(
        k,
        surface,
        outer,
        limit,
        found.depth_max,
        found.depth_mean,
        found.nesting_min,
        found.self_intersections,
        found.depth_max_back,
        found.full_mean,
        found.outside,
        tuple(float(v) for v in found.histogram),
    )
