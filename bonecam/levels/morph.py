"""The morph: from the part to the stock in as few levels as the depths allow (Gan et al. 2014, section 4.2).

Every level has the T-mesh and weights of the part; only control points change. Levels are made until every point of the
stock's surface lies within one depth of the last one; the stock itself is the level after that.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError
from bonecam.levels.attraction import ATTRACTIONS
from bonecam.levels.check import measure, require
from bonecam.levels.grid import LevelGrid, level_grid
from bonecam.levels.level import Level
from bonecam.levels.schedule import Schedule
from bonecam.levels.setting import setting_of
from bonecam.levels.step import next_level
from bonecam.levels.stock import MARGIN, Stock, require_inside
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, part, report, silent
from bonecam.surface.tspline import TSpline

SMOOTHING = 1e-6
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
    chord_tolerance: float = 0.01,
    progress: Progress = silent,
) -> Morph:
    """All levels, measured on tessellations within `chord_tolerance` mm.

    `stiffness` is c_int / c_ext (parameters in [0, 1]); it falls where progress stalls. Raises StockError where the part
    is not inside the stock, LevelError where a level cannot be made or fails its check.
    """
    if attraction not in ATTRACTIONS:
        raise ValueError(f"attraction {attraction!r}: choose one of {', '.join(ATTRACTIONS)}")
    coarse = level_grid(surface, [surface.control_points], COARSE)
    require_inside(stock, coarse.mesh(surface.control_points).vertices, MARGIN)
    start = time.perf_counter()
    sequence = _Sequence(surface, stock, schedule, stiffness, attraction, coarse)
    made = [np.array(surface.control_points)]
    for control_points in sequence.run():
        made.append(control_points)
        report(progress, 0.7 * min(1.0, len(made) / max(sequence.lower_bound, 1)), f"level {len(made) - 1}")
    solved = time.perf_counter()
    levels = _measured(surface, made, stock, schedule, chord_tolerance, part(progress, 0.7, 1.0))
    return Morph(levels, sequence.lower_bound, sequence.distance, solved - start, time.perf_counter() - solved)


class _Sequence:
    """The levels between part and stock, one after the other."""

    def __init__(self, surface: TSpline, stock: Stock, schedule: Schedule, stiffness: float, attraction: str, coarse: LevelGrid) -> None:
        self.setting = setting_of(surface, stock, ATTRACTIONS[attraction], SMOOTHING)
        self.schedule, self.stiffness, self.coarse = schedule, stiffness, coarse
        self.control_points = np.array(surface.control_points)
        self.targets = stock.mesh(COARSE).vertices
        self.distance, _ = self.remaining(self.control_points)
        self.lower_bound = schedule.lower_bound(self.distance)

    def remaining(self, control_points: Float[ndarray, "c 3"]) -> tuple[float, ndarray]:
        """The largest distance from the stock to the level, mm, and where."""
        distance = MeshDistance(self.coarse.mesh(control_points)).unsigned(self.targets)
        return float(distance.max()), self.targets[np.argmax(distance)]

    def run(self) -> Iterator[ndarray]:
        """Control points of levels 1, 2, ... up to the last below the stock."""
        P, left, stiffness, stalls = self.control_points, self.distance, self.stiffness, 0
        allowance, k = np.ones(len(P)), 1
        while left > self.schedule.limit(k):
            depth = self.schedule.limit(k)
            step = next_level(self.setting, P, depth, stiffness, allowance)
            P, allowance = P + step.moves, step.allowance
            before, (left, place) = left, self.remaining(P)
            stalled = left > before - STALL * depth
            stalls = stalls + 1 if stalled else 0
            stiffness = stiffness * SOFTEN if stalled else stiffness
            if stalls > PATIENCE:
                where = f"({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f})"
                raise LevelError(
                    f"level {k} gets no nearer to the stock than {left:.3f} mm at {where}: give more control points", level=k, place=place
                )
            yield P
            k += 1


def _measured(
    surface: TSpline, made: Sequence[ndarray], stock: Stock, schedule: Schedule, chord_tolerance: float, progress: Progress
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
        levels.append(_level(k, shape, meshes[k - 1], meshes[k], stock, schedule.limit(k)))
    return tuple(levels)


def _level(k: int, surface: TSpline | None, inner: TriangleMesh, outer: TriangleMesh, stock: Stock, limit: float) -> Level:
    found = measure(inner, outer, stock, limit, surface is None)
    require(k, found, limit, inner, outer, stock)
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
