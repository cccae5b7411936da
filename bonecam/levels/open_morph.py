"""The T-spline of a smooth convex body: fitted by least squares to the points of the body nearest to those on
the meridians of a capsule round it.

Where a surface with even knots is not near enough, the knots are placed where the points bend.

The morph of an open surface (a blade): level 0 is the surface, the last level its stock, an offset of it
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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.ndimage import gaussian_filter1d

from bonecam.arrays import ROUNDING, dots, lengths
from bonecam.errors import JobError, LevelError, StockError, SurfaceError, place_name
from bonecam.job import LevelsJob
from bonecam.levels.closed_morph import require_types
from bonecam.levels.measure import (
    LevelGrid,
    MachinedLevel,
    MeasuredSurface,
    Measures,
    MorphLevel,
    StockLevel,
    distances_to,
    measure_open_cut,
    measure_part,
    open_level_grid,
    require_none,
    violations,
)
from bonecam.levels.problem import NESTING_TOLERANCE, ElementMatrices, element_matrices, factorise
from bonecam.levels.program import LinearLimits
from bonecam.levels.sequences import Morph, Stop, levels_to_stock
from bonecam.levels.solvers.osqp import solve_qp
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, silent
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.setup.capsule import Capsule, enclosing_capsule
from bonecam.setup.stock import Schedule, Stock
from bonecam.surface.query import Projection
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

TOLERANCE = 0.002
"""How far (mm) a surface may be off its body, measured between the points it is fitted to."""

ROW_STEP = 0.4
"""Distance (mm) along a meridian of the rows of control points, at first."""

MIN_ROWS = 40
"""Fewest rows of control points, at first."""

MAX_ROWS = 160
"""Most rows of control points, at first."""

AROUND_ROUND = 32
"""Control points of a row, at first, where no body has flats."""

AROUND_FLAT = 96
"""Control points of a row, at first, where a body has flats."""

SAMPLES = 3
"""Points in each knot interval that the surface is fitted to."""

CHECKS = 2
"""Places in a patch, each way, at which its distance from the body is measured: between the fitted points."""

FINER = 1.3
"""Factor on the control points each way from one try to the next, where a surface is off."""

MAX_TRIES = 4
"""Most tries with knots where the points bend."""

LEAST_DENSITY = 0.3
"""Least density of knots, share of their mean density."""

SMOOTHING = SAMPLES / 2
"""Standard deviation of the Gaussian, in points, that smooths the steps between points."""

POLE_WEIGHT = 100.0
"""Weight of the poles, beside one of every other point: a single control point shapes each."""


def meridians(capsule: Capsule, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Points of an upright capsule: s turns round the axis, t is the share of the arc from the lower to the
    upper pole."""
    quarter = capsule.radius * np.pi / 2
    straight = capsule.length - 2 * capsule.radius
    arc = t * (2 * quarter + straight) - quarter
    rise = np.clip(arc, 0, straight)
    angle = (arc - rise) / capsule.radius
    across = capsule.radius * np.cos(angle)
    local = [across * np.cos(2 * np.pi * s), across * np.sin(2 * np.pi * s), rise + capsule.radius * np.sin(angle)]
    return capsule.start + np.column_stack(local)


def body_surfaces(bodies: Sequence[Stock]) -> list[TSpline]:
    """The surfaces of smooth convex bodies, lower pole first, all on one T-mesh, within TOLERANCE as
    measured.

    LevelError with the distance and the place where they are farther off with the most control points.
    """
    around = AROUND_FLAT if any(body.has_flats for body in bodies) else AROUND_ROUND
    capsules = [enclosing_capsule(body) for body in bodies]
    arc = max(np.pi * capsule.radius + capsule.length for capsule in capsules)
    rows = int(np.clip(np.ceil(arc / ROW_STEP), MIN_ROWS, MAX_ROWS))
    distance = np.inf
    place = np.zeros(3)
    for s_knots, t_knots, smooth in _knots_to_try(bodies, capsules, around, rows):
        surfaces = _fit_body(bodies, capsules, s_knots, t_knots, smooth)
        distance, place = max(
            (_largest_distance(body, surface) for body, surface in zip(bodies, surfaces)), key=lambda one: one[0]
        )
        if distance <= TOLERANCE:
            return surfaces
    raise LevelError(
        f"the surface of the rounded stock is {distance:.4f} mm off it at {place_name(place)}, more than "
        f"{TOLERANCE} mm: give a larger "
        "stock, whose edges can be rounder, or a capsule",
        distance=distance,
        place=place,
    )


def _knots_to_try(
    bodies: Sequence[Stock], capsules: Sequence[Capsule], around: int, rows: int
) -> Iterator[tuple[ndarray, ndarray, bool]]:
    """Knots round and along the bodies, and whether steps are smoothed: first even ones, then where the
    bodies bend, more and more."""
    yield np.arange(around) / around, np.linspace(0, 1, rows - 2), False
    s = np.arange(SAMPLES * around) / (SAMPLES * around)
    t = np.linspace(0, 1, SAMPLES * rows)
    grids = [_points_of_body(body, capsule, s, t) for body, capsule in zip(bodies, capsules)]
    along_s = np.max([_knot_density(grid.swapaxes(0, 1)) for grid in grids], axis=0)
    along_t = np.max([_knot_density(grid) for grid in grids], axis=0)
    for finer in FINER ** np.arange(MAX_TRIES):
        yield (
            _knots_by_density(np.append(along_s, along_s[0]), int(finer * around))[:-1],
            _knots_by_density(along_t, int(finer * rows) - 3),
            True,
        )


def _points_of_body(
    body: Stock, capsule: Capsule, s: Float[ndarray, " a"], t: Float[ndarray, " b"]
) -> Float[ndarray, "b a 3"]:
    """The points of the body nearest to those of the capsule at all pairs of s and t."""
    ss, tt = (v.ravel() for v in np.meshgrid(s, t))
    return body.closest_points(meridians(capsule, ss, tt)).reshape(len(t), len(s), 3)


def _knot_density(grid: Float[ndarray, "b a 3"]) -> Float[ndarray, " b"]:
    """The density of knots along the first index that makes the error of a fit even: the root of the largest
    second difference there."""
    second = np.linalg.norm(np.diff(grid, 2, axis=0), axis=2).max(1)
    density = np.sqrt(np.concatenate([second[:1], second, second[-1:]]))
    return np.maximum(density, LEAST_DENSITY * density.mean())


def _knots_by_density(density: Float[ndarray, " b"], count: int) -> Float[ndarray, " k"]:
    """The ends of `count` intervals of [0, 1], each with the same share of the density."""
    share = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    return np.interp(np.linspace(0, share[-1], count + 1), share, np.linspace(0, 1, len(density)))


def _places_between(knots: Float[ndarray, " k"], count: int) -> Float[ndarray, " n"]:
    """The last knot, and before it `count` evenly spaced places from each knot on."""
    return np.interp(np.arange(count * (len(knots) - 1) + 1) / count, np.arange(len(knots)), knots)


def _fit_body(
    bodies: Sequence[Stock],
    capsules: Sequence[Capsule],
    s_knots: Float[ndarray, " a"],
    t_knots: Float[ndarray, " b"],
    smooth: bool,
) -> list[TSpline]:
    """The surfaces of the bodies on the T-mesh with these knots, by least squares; `smooth` fits them to
    points whose steps are smoothed."""
    rows = len(t_knots) + 2
    clamped = np.concatenate([np.zeros(3), t_knots, np.ones(3)])
    tmesh = RowTMesh.from_rows(clamped, [np.zeros(1), *[s_knots] * (rows - 2), np.zeros(1)])
    spline = TSpline(tmesh, np.zeros((tmesh.size, 3)), np.ones(tmesh.size))
    s = _places_between(np.append(s_knots, 1.0), SAMPLES)[:-1]
    t = _places_between(t_knots, SAMPLES)
    ss, tt = (v.ravel() for v in np.meshgrid(s, t))
    R = spline.basis(ss, tt)[0]
    weighted = sp.csr_array(R.T @ sp.diags_array(np.where((tt == 0) | (tt == 1), POLE_WEIGHT, 1.0)))
    fit = factorise(sp.csc_array(weighted @ R))
    grids = [_points_of_body(body, capsule, s, t) for body, capsule in zip(bodies, capsules)]
    surfaces = []
    for body, grid in zip(bodies, grids, strict=True):
        targets = grid.reshape(-1, 3)
        if smooth:
            # without the jumps that steps have at the ends of flats: after such a jump a spline oscillates, and may
            # turn over
            wide = int(4 * SMOOTHING)
            over_poles = np.pad(grid, ((wide, wide), (0, 0), (0, 0)), mode="reflect", reflect_type="odd")
            even = gaussian_filter1d(gaussian_filter1d(over_poles, SMOOTHING, axis=0), SMOOTHING, axis=1, mode="wrap")
            targets = body.closest_points(even[wide:-wide].reshape(-1, 3))
        surfaces.append(spline.with_control_points(fit.solve(np.asarray(weighted @ targets))))
    return surfaces


def _largest_distance(body: Stock, surface: TSpline) -> tuple[float, Float[ndarray, "3"]]:
    """How far the surface is off the body at most, at places of every patch and at the poles, and where."""
    assert isinstance(surface.tmesh, RowTMesh)
    s = _places_between(np.append(surface.tmesh.s_knots[1], 1.0), 2 * CHECKS)
    t = _places_between(surface.tmesh.t_knots[3:-3], 2 * CHECKS)
    ss, tt = np.meshgrid(s[1::2], np.concatenate([t[:1], t[1::2], t[-1:]]))
    points = surface.positions(ss.ravel(), tt.ravel())
    distance = np.abs(body.signed_distance(points))
    worst = int(np.argmax(distance))
    return float(distance[worst]), points[worst]


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
        way = "bonecam.levels.job_levels.levels_in(surface, stock, schedule)"
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
    limit = schedule.limit(lower_bound)
    if target.deviation > limit:
        raise StockError(
            f"the stock over the part's control points lies {target.deviation:.3f} mm off the one given at "
            f"{place_name(target.place)}, "
            f"more than one cut ({limit:.3f} mm): give a smoother stock or more control points",
            distance=target.deviation,
            place=target.place,
        )

    def next_level(level: MachinedLevel, k: int, _: _Rest) -> MachinedLevel:
        limit = schedule.limit(k)
        surface = _next_surface(level.surface, target, matrices, limit, stiffness, held=matrices.edge & fixed)
        measures, mesh = _measured(k, level.surface, surface, target, grid, limit=limit)
        return MorphLevel(k, surface, mesh, limit, measures)

    def rest_above(level: MachinedLevel, k: int, _: _Rest | None = None) -> _Rest:
        return _rest(level.surface, target, grid, schedule.limit(k + 1))

    first: MachinedLevel = measure_part(MeasuredSurface(surface, grid))
    levels = levels_to_stock(
        [first],
        rest_above(first, 0),
        schedule,
        next_level,
        rest_above,
        stop=Stop(SOFTER),
        progress=progress,
        lower_bound=lower_bound,
    )

    # The stock as the last level, with what is measured on its cut; LevelError where that is out of tolerance
    k = len(levels)
    limit = schedule.limit(k)
    measures, mesh = _measured(k, levels[-1].surface, target.surface, target, grid, limit=limit)
    fitted = replace(measures, outside=target.deviation, outside_place=target.place)
    return Morph((*levels, StockLevel(k, mesh, limit, fitted)), lower_bound, distance, 0.0, 0.0)


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
