"""The morph of an open surface (a blade): level 0 is the surface, the last level its stock, an offset of it
or a given surface.

An open surface has no inside, so the stock is a surface too, fitted over the same T-mesh: control points Q
for the part's P. A level solves the published energy (Gan et al. 2014, section 4.2) with the stock's own
points as source of attraction,

    min  c_int (P + x - Q)' M (P + x - Q) + c_ext int |R (P + x - Q)|^2      s.t. 0 <= x_i <= eps_k on the way
    from P_i to Q_i,

every control point on its straight way: the blending functions are non-negative and sum to one, so that no
point of the surface moves further than eps_k, and none falls behind where the ways lie on the outer side. A
given stock is met at its nearest points. Fixed edges keep their control points: all levels hang on the part's
edges, and the stock bends down to them.

The stock of an open surface: as given, an offset or a mesh on one side of the part, and fitted over the
part's T-mesh.

The fit is by least squares, each Gauss point of the part going to its place on the stock as given: so far
along its normal, or the nearest. Both are looked at over many points of the part and, of a mesh, at the
vertices that stand above the part within its edges. A T-spline over the part's own T-mesh is the stock as it
is, each point of the part going to the one with its parameters. A mesh must lie on one side (where the edges
are fixed it
may touch the part), and the fit must not turn over. An offset is all that lies just so far from the part: its
places nearer to another part of it do not belong to it. What lies between these points is not seen.
"""

from dataclasses import dataclass, replace
from numbers import Real

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import ROUNDING, dots, lengths
from bonecam.errors import JobError, LevelError, StockError, SurfaceError, place_name
from bonecam.job import LevelsJob
from bonecam.levels.closed_morph import require_types
from bonecam.levels.measure.cut_measures import Measures
from bonecam.levels.measure.grid import LevelGrid, open_level_grid
from bonecam.levels.measure.inspection import measure_part
from bonecam.levels.measure.level import Level, MachinedLevel, MorphLevel, StockLevel
from bonecam.levels.measure.measure_open_cut import distances_to, measure_open_cut
from bonecam.levels.measure.measured_surface import MeasuredSurface
from bonecam.levels.measure.violations import require_none, violations
from bonecam.levels.problem.element_matrices import ElementMatrices, element_matrices
from bonecam.levels.problem.factorisation import factorise
from bonecam.levels.problem.limits.linear_limits import LinearLimits
from bonecam.levels.problem.tolerances import NESTING_TOLERANCE
from bonecam.levels.sequences.begun_morph import Morph
from bonecam.levels.sequences.loop import Stop, levels_to_stock
from bonecam.levels.solvers.osqp import solve_qp
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, silent
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.setup.schedule import Schedule
from bonecam.surface.query.closest_point import Projection
from bonecam.surface.tspline import TSpline

FIT_STIFFNESS = 1e-16
"""Weight of the thin-plate energy in the fit of the stock: only what no Gauss
point shapes follows it."""

CHORD = 0.01
"""Chord tolerance (mm) of the tessellations on which part and stock are compared, the default of levels."""

ABOVE = 1 - 1e-6
"""Least cosine of the angle between a normal of the part and the direction to a point straight above it."""


@dataclass(frozen=True, eq=False)
class OpenStock:
    """The stock of an open surface: its `surface` over the part's T-mesh; the `side` of the part on which it
    lies (1: where the normals point); `points` of the stock as given (bent to the edges where they are fixed)
    and the `parameters` of their footpoints; the distance (mm) of the stock as given from the part where it
    is `farthest`; and the largest distance (mm) of the two stocks, the `deviation`, at `place`."""

    surface: TSpline
    side: float
    points: Float[ndarray, "n 3"]
    parameters: Float[ndarray, "n 2"]
    farthest: float
    deviation: float
    place: Float[ndarray, "3"]


def open_stock(surface: TSpline, matrices: ElementMatrices, stock: object, fixed: bool) -> OpenStock:
    """The stock as given (an offset in mm, a mesh or a T-spline) fitted over the T-mesh of the part, with the
    part's edges `fixed` or not; StockError where it is no stock, or not on one side of the part."""
    given = _given(stock)
    over = stock if isinstance(stock, TSpline) and stock.tmesh is surface.tmesh else None
    at = np.vstack([surface.seeds.parameters, surface.tessellate_with_parameters(CHORD).parameters])
    points, normals = surface.positions(*at.T), surface.normals(*at.T)
    wanted = _wanted(given, points, normals) if over is None else over.positions(*at.T)
    side = float(np.sign(np.median(dots(wanted - points, normals)))) or 1.0
    if isinstance(given, float):
        known = wanted[distances_to(surface, wanted, at) >= abs(given) - NESTING_TOLERANCE]
    else:
        vertices, footpoints = _above(surface, given.vertices)
        known = np.vstack([wanted, vertices])
        places = np.vstack([points, vertices])
        ahead = dots(
            known - np.vstack([points, footpoints.points]),
            np.vstack([normals, surface.normals(*footpoints.parameters.T)]),
        )
        _require_ahead(side * ahead, places, -NESTING_TOLERANCE if fixed else NESTING_TOLERANCE)
    free = _fit(surface, matrices, given) if over is None else over
    held = (matrices.edge & fixed)[:, None]
    bent = free.with_control_points(np.where(held, surface.control_points, free.control_points))
    fitted = free.positions(*at.T)
    reached = bent.positions(*at.T)

    # StockError where the fit faces against the part
    _, S_s, S_t = bent.derivatives(at[:, 0], at[:, 1], 1)
    upright = dots(np.cross(S_s, S_t), normals)
    if upright.min() <= 0:
        place = bent.positions(*at[[np.argmin(upright)]].T)[0]
        remedy = "give one that reaches over all of the part, nearer to it than its radii of curvature"
        message = f"the stock turns over at {place_name(place)}: {remedy}"
        raise StockError(message, place=place)

    _require_ahead(side * dots(reached - points, normals), points, -NESTING_TOLERANCE)
    known, footpoints = _above(free, known)
    off = (
        distances_to(surface, fitted, at) - abs(given)
        if isinstance(given, float)
        else lengths(fitted - exact_closest(given, fitted)[0])
    )
    off = np.append(np.abs(off), footpoints.distances)
    places = np.vstack([fitted, known])
    worst = int(np.argmax(off))
    moved, moved_footpoints = (
        free.basis(*which.T)[0] @ (matrices.edge & fixed) > 0 for which in (at, footpoints.parameters)
    )
    return OpenStock(
        surface=bent,
        side=side,
        points=np.vstack([known[~moved_footpoints], reached[moved]]),
        parameters=np.vstack([footpoints.parameters[~moved_footpoints], at[moved]]),
        farthest=float(distances_to(surface, known, footpoints.parameters).max(initial=0.0)),
        deviation=float(off[worst]),
        place=places[worst],
    )


def _given(stock: object) -> float | TriangleMesh:
    """The stock as given, as an offset in mm or as a mesh; StockError where it is neither."""
    if isinstance(stock, Real):
        if not (np.isfinite(float(stock)) and stock != 0):
            raise StockError(
                f"an offset of {stock} mm is no stock: give a distance above or below zero", distance=float(stock)
            )
        return float(stock)
    mesh = stock.tessellate(CHORD) if isinstance(stock, TSpline) else stock
    if not isinstance(mesh, TriangleMesh) or not len(mesh.faces):
        message = "a mesh without faces" if isinstance(mesh, TriangleMesh) else f"a {type(stock).__name__}"
        raise StockError(f"{message} is no stock of an open surface: give an offset in mm, a TriangleMesh or a TSpline")
    return mesh


def _wanted(given: float | TriangleMesh, points: ndarray, normals: ndarray) -> Float[ndarray, "n 3"]:
    """Where points of the part go on the stock as given."""
    return np.asarray(points + given * normals) if isinstance(given, float) else exact_closest(given, points)[0]


def _above(surface: TSpline, points: ndarray) -> tuple[Float[ndarray, "n 3"], Projection]:
    """The points that stand straight above or below the surface, and their closest points on it: a point
    beyond its edges does not."""
    projection = surface.project(points)
    heights = np.abs(dots(points - projection.points, surface.normals(*projection.parameters.T)))
    kept = heights >= ABOVE * projection.distances
    return points[kept], Projection(*(each[kept] for each in projection))


def _require_ahead(ahead: ndarray, points: ndarray, least: float) -> None:
    """StockError where the stock lies less than `least` mm ahead of the part."""
    worst = int(np.argmin(ahead))
    if ahead[worst] < least:
        how = f"lies {-ahead[worst]:.3f} mm behind" if ahead[worst] < -NESTING_TOLERANCE else "touches"
        message = f"the stock {how} the part at {place_name(points[worst])}: give one on one side of it"
        raise StockError(message, distance=float(-ahead[worst]), place=points[worst])


def _fit(surface: TSpline, matrices: ElementMatrices, given: float | TriangleMesh) -> TSpline:
    """The stock over the part's T-mesh, with free edges."""
    points = matrices.R @ surface.control_points
    ways = matrices.weights[:, None] * (_wanted(given, points, matrices.normals) - points)
    way = factorise(matrices.N + FIT_STIFFNESS * matrices.M).solve(np.asarray(matrices.R.T @ ways))
    return surface.with_control_points(surface.control_points + way)


EDGES = ("free", "fixed")
"""What the edges of the levels do: go with those of the stock, or stay with those of the part."""
STIFFNESS = 1e-9
"""c_int / c_ext of the energy unless given."""
SOLVER_TOLERANCE = 2e-6
"""Tolerance of the program's solver: moves are off by so many mm at most, a thousandth of what depths may be."""
STRIDE = 50
"""One of so many points is measured first to see whether a level is still too far from the stock."""
LEAST_MOVE = 0.01
"""A level whose control points all move by less than this share of its depth gets no nearer to the stock."""
REMEDY, SOFTER = "give a higher stiffness or other edges", "give a lower stiffness"
"""What to do about a level that breaks its limits, and about one that gets no nearer to the stock."""


@on_one_blas_thread
def morph_open(
    surface: TSpline,
    stock: object,
    schedule: Schedule,
    *,
    edges: str = "free",
    stiffness: float = STIFFNESS,
    chord_tolerance: float = 0.01,
    progress: Progress = silent,
) -> Morph:
    """All levels from an open surface to its stock: so many mm along its normals (negative: behind it), or a
    given surface on one side.

    `stock`: a number, a TriangleMesh or a TSpline (one over the T-mesh of the part is met point by point,
    another at its nearest points); `outside` of the last level is how far its fit lies off
    it, at most one cut. `edges`: `free`, or `fixed` to those of the part. Raises SurfaceError where the
    surface is closed, JobError where a parameter is wrong, StockError where the stock is not on one side of
    the part or its fit too far off, LevelError where a level cannot be made or fails.
    """
    # Raise the error of `morph_open` for a closed surface or a parameter out of its range
    require_types(surface, schedule)
    LevelsJob(chord_tolerance=chord_tolerance)  # raises where it is out of range
    if edges not in EDGES:
        raise JobError(f"edges = {edges!r}: choose one of {', '.join(EDGES)}", field="edges")
    if not 0 <= stiffness < np.inf:
        raise JobError(f"stiffness = {stiffness!r}: give a finite number of zero or more", field="stiffness")
    if all(surface.poles) or all(surface.elements().period):
        way = "bonecam.levels.edge_rounding.levels_in(surface, stock, schedule)"
        raise SurfaceError(f"the surface is closed: morph it into a stock with {way}")

    matrices = element_matrices(surface)
    fixed = edges == "fixed"
    target = open_stock(surface, matrices, stock, fixed)
    grid = open_level_grid(surface, target.surface, chord_tolerance)

    from_stock = distances_to(surface, target.points, target.parameters)
    distance = min(float(from_stock.max(initial=0.0)), target.farthest)  # its fit may bulge beyond fixed edges
    inner_points = grid.points(surface.control_points)
    from_part = distances_to(target.surface, inner_points, grid.sample_parameters)
    deepest = float(from_part.max()) - target.deviation
    lower_bound = schedule.lower_bound(max(distance, deepest))
    _require_near(target, schedule.limit(lower_bound))

    held = matrices.edge & fixed
    levels = _sequence(
        surface,
        target,
        matrices,
        grid,
        schedule,
        stiffness=stiffness,
        held=held,
        progress=progress,
        lower_bound=lower_bound,
    )
    return Morph(levels, lower_bound, distance, 0.0, 0.0)


def _sequence(
    surface: TSpline,
    target: OpenStock,
    matrices: ElementMatrices,
    grid: LevelGrid,
    schedule: Schedule,
    stiffness: float,
    held: Bool[ndarray, " c"],
    progress: Progress,
    lower_bound: int,
) -> tuple[Level, ...]:
    """The levels from a surface to its stock, each measured when it is made; control points `held` stay."""

    def next_level(level: MachinedLevel, k: int, _: _Rest) -> MachinedLevel:
        limit = schedule.limit(k)
        surface = _next_surface(level.surface, target, matrices, limit, stiffness, held=held)
        measures, mesh = _measured(k, level.surface, surface, target, grid, limit=limit)
        return MorphLevel(k, surface, mesh, limit, measures)

    def rest_above(level: MachinedLevel, k: int, _: _Rest | None = None) -> _Rest:
        return _rest(level.surface, target, grid, schedule.limit(k + 1))

    first: MachinedLevel = measure_part(MeasuredSurface(surface, grid))
    rest = rest_above(first, 0)
    stop = Stop(SOFTER)
    levels = levels_to_stock(
        [first], rest, schedule, next_level, rest_above, stop=stop, progress=progress, lower_bound=lower_bound
    )

    # The stock as the last level, with what is measured on its cut; LevelError where that is out of tolerance
    below = levels[-1]
    limit = schedule.limit(len(levels))
    k = below.index + 1
    measures, mesh = _measured(k, below.surface, target.surface, target, grid, limit=limit)
    fitted = replace(measures, outside=target.deviation, outside_place=target.place)
    return *levels, StockLevel(k, mesh, limit, fitted)


@dataclass(frozen=True, eq=False)
class _Rest:
    """The largest distance found between a level and the stock, less what rounding adds: `left` mm at `place`."""

    left: float
    place: Float[ndarray, "3"]


def _rest(level: TSpline, target: OpenStock, grid: LevelGrid, limit: float) -> _Rest:
    """What is left between a level and the stock, from either to the other: as soon as more than `limit` mm are
    found no more is sought."""
    its = np.vstack([target.points, grid.points(target.surface.control_points)])
    at = np.vstack([target.parameters, grid.sample_parameters])
    own = grid.points(level.control_points)
    rest = _Rest(0.0, own[0])
    for surface, points, parameters in ((target.surface, own, grid.sample_parameters), (level, its, at)):
        for some in (slice(None, None, STRIDE), slice(None)):
            distances = distances_to(surface, points[some], parameters[some]) - ROUNDING
            worst = int(np.argmax(distances))
            if distances[worst] > rest.left:
                rest = _Rest(float(distances[worst]), points[some][worst])
            if rest.left > limit:
                return rest
    return rest


def _next_surface(
    level: TSpline, target: OpenStock, matrices: ElementMatrices, limit: float, stiffness: float, held: ndarray
) -> TSpline:
    """The surface of the level above one; LevelError where it hardly moves."""
    P = level.control_points

    # The moves of the control points P to the next level, each on its straight way to its target in Q, `depth` mm at
    # most; those `held` stay. They solve the level's program, in the distances x that they go.
    way = target.surface.control_points - P
    length = np.linalg.norm(way, axis=1)
    direction = way / np.where(length > 0, length, 1.0)[:, None]
    most = np.where(held, 0.0, np.minimum(length, limit))

    energy = sp.csc_array(stiffness * matrices.M + matrices.N)
    along = [sp.diags_array(direction[:, j]) for j in range(3)]
    x, y, z = (sp.csc_array(D @ energy @ D) for D in along)
    gradient = -((energy @ way) * direction).sum(1)
    limits = LinearLimits(sp.eye_array(len(P), format="csr"), np.zeros(len(P)), most)
    distance = np.clip(solve_qp(sp.csc_array(x + y + z), gradient, limits, SOLVER_TOLERANCE), 0.0, most)
    moves = distance[:, None] * direction

    if np.linalg.norm(moves, axis=1).max() < LEAST_MOVE * limit:
        raise LevelError(f"no control point gets nearer to the stock: {SOFTER}")
    return level.with_control_points(P + moves)


def _measured(
    k: int, inner: TSpline, outer: TSpline, stock: OpenStock, grid: LevelGrid, limit: float
) -> tuple[Measures, TriangleMesh]:
    """What is measured on cut k, and the tessellation of its outer level; LevelError where it is out of
    tolerance."""
    below, above = MeasuredSurface(inner, grid), MeasuredSurface(outer, grid)
    measures = measure_open_cut(below, above, stock.surface, stock.side, limit)
    require_none(k, violations(measures, limit, above.mesh), above.mesh, REMEDY)
    return measures, above.mesh


def _require_near(stock: OpenStock, limit: float) -> None:
    """StockError where the stock over the part's T-mesh lies more than `limit` mm off the one given."""
    if stock.deviation > limit:
        raise StockError(
            f"the stock over the part's control points lies {stock.deviation:.3f} mm off the one given at "
            f"{place_name(stock.place)}, "
            f"more than one cut ({limit:.3f} mm): give a smoother stock or more control points",
            distance=stock.deviation,
            place=stock.place,
        )
