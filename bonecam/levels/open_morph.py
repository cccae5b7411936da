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
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import ROUNDING, dots, lengths
from bonecam.errors import JobError, LevelError, StockError, SurfaceError, place_name
from bonecam.job import LevelsJob
from bonecam.levels.closed_morph import Morph, require_types
from bonecam.levels.measure.check import BINS, REMAINS, patch_of
from bonecam.levels.measure.level import Level
from bonecam.levels.open_stock import OpenStock, distances, open_stock
from bonecam.levels.problem.element_matrices import ElementMatrices, element_matrices
from bonecam.levels.problem.limits.linear_limits import LinearLimits
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE, NEST_TOLERANCE
from bonecam.levels.solvers.osqp import solve_qp
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report, silent
from bonecam.setup.schedule import Schedule
from bonecam.surface.tspline import TSpline
from bonecam.threads import on_one_blas_thread

EDGES = ("free", "fixed")
STIFFNESS, SOLVER_TOLERANCE = 1e-9, 2e-6
FEW = 50
"""Of so many points of the stock one is asked first whether it is still too far from a level."""


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

    `stock`: a number, a TriangleMesh or a TSpline; `outside` of the last level is how far its fit lies off
    it, at most one cut. `edges`: `free`, or `fixed` to those of the part. Raises SurfaceError where the
    surface is closed, JobError where a parameter is wrong, StockError where the stock is not on one side of
    the part or its fit too far off, LevelError where a level cannot be made or fails.
    """
    require_types(surface, schedule)
    LevelsJob(chord_tolerance=chord_tolerance)  # raises where it is out of range
    if edges not in EDGES:
        raise JobError(f"edges = {edges!r}: choose one of {', '.join(EDGES)}", field="edges")
    if not 0 <= stiffness < np.inf:
        raise JobError(f"stiffness = {stiffness!r}: give a finite number of zero or more", field="stiffness")
    if all(surface.poles) or all(surface.elements().period):
        raise SurfaceError(
            "the surface is closed: morph it into a stock with bonecam.levels.edge_rounding.levels_in(surface, stock, schedule)"
        )
    matrices = element_matrices(surface)
    held = matrices.edge & (edges == "fixed")
    found = open_stock(surface, matrices, stock, edges == "fixed")
    target, distances_to_it = found.surface, distances(surface, found.points, found.parameters)
    distance = min(
        float(distances_to_it.max(initial=0.0)), found.farthest
    )  # where it bends down to fixed edges its fit may bulge farther
    grid = _grid(surface, target, chord_tolerance)
    deepest = float(distances(target, grid.points(surface), grid.all).max()) - found.deviation
    lower_bound = schedule.lower_bound(max(distance, deepest))
    _require_near(found, schedule.limit(lower_bound))
    points, at = np.vstack([found.points, grid.points(target)]), np.vstack([found.parameters, grid.all])
    shapes = [surface]
    while _beyond(
        target, grid.points(shapes[-1]), grid.all, limit := schedule.limit(k := len(shapes))
    ) or _beyond(shapes[-1], points, at, limit):
        report(progress, min(1.0, k / lower_bound), f"level {k}")
        moves = _moves(matrices, shapes[-1].control_points, target.control_points, limit, stiffness, held)
        if np.linalg.norm(moves, axis=1).max() < limit / 100:
            raise LevelError(f"level {k} gets no nearer to the stock: give a lower stiffness", level=k)
        shapes.append(surface.with_control_points(shapes[-1].control_points + moves))
    levels = [
        Level(0, surface, mesh := grid.mesh(surface), 0.0, 0.0, 0.0, 0.0, len(self_intersections(mesh)))
    ]
    for k, (inner, outer) in enumerate(pairwise([*shapes, target]), start=1):
        levels.append(_level(k, inner, outer, grid, schedule.limit(k), found))
    levels[-1] = replace(levels[-1], surface=None, outside=found.deviation)
    return Morph(tuple(levels), lower_bound, distance, 0.0, 0.0)


def _beyond(surface: TSpline, points: Float[ndarray, "n 3"], at: Float[ndarray, "n 2"], limit: float) -> bool:
    """Whether one of the points lies farther than `limit` mm from a level; a few are asked first."""
    return any(
        bool((distances(surface, points[some], at[some]) > limit + ROUNDING).any())
        for some in (slice(None, None, FEW), slice(None))
    )


def _require_near(stock: OpenStock, limit: float) -> None:
    """StockError where the stock over the part's T-mesh lies more than `limit` mm off the one given."""
    if stock.deviation > limit:
        raise StockError(
            f"the stock over the part's control points lies {stock.deviation:.3f} mm off the one given at {place_name(stock.place)}, "
            f"more than one cut ({limit:.3f} mm): give a smoother stock or more control points",
            distance=stock.deviation,
            place=stock.place,
        )


@dataclass(frozen=True, eq=False)
class _Grid:
    """One parameter mesh for all levels: (s, t) of its vertices and of its faces' middles."""

    parameters: Float[ndarray, "v 2"]
    middles: Float[ndarray, "f 2"]
    faces: ndarray

    def mesh(self, surface: TSpline) -> TriangleMesh:
        """The tessellation of a level."""
        return TriangleMesh(surface.positions(*self.parameters.T), self.faces)

    def points(self, surface: TSpline) -> Float[ndarray, "n 3"]:
        """Points of a level: at the vertices, then at the middles."""
        return surface.positions(*self.all.T)

    @property
    def all(self) -> Float[ndarray, "n 2"]:
        """(s, t) of the vertices, then of the middles."""
        return np.vstack([self.parameters, self.middles])


def _grid(surface: TSpline, target: TSpline, chord: float) -> _Grid:
    """The parameter mesh of the part or of the stock, whichever needs more faces."""
    finer = max(
        (each.tessellate_with_parameters(chord) for each in (surface, target)),
        key=lambda found: len(found.mesh.faces),
    )
    return _Grid(
        finer.parameters,
        _middles(finer.parameters, finer.mesh.faces, surface.elements().period),
        finer.mesh.faces,
    )


def _middles(parameters: ndarray, faces: ndarray, period: tuple[float, float]) -> Float[ndarray, "f 2"]:
    """(s, t) in the middle of each face, also where it lies across a seam."""
    first, turn = parameters[faces[:, 0]], np.array(period)
    offset = parameters[faces] - first[:, None]
    offset -= turn * np.round(offset / np.where(turn > 0, turn, 1.0))
    return np.asarray(first + offset.mean(1))


def _moves(
    matrices: ElementMatrices, P: ndarray, Q: ndarray, depth: float, stiffness: float, held: ndarray
) -> ndarray:
    """The level's program: how far every control point goes on its straight way to its target."""
    way = Q - P
    rest = np.linalg.norm(way, axis=1)
    ahead = way / np.where(rest > 0, rest, 1.0)[:, None]
    most = np.where(held, 0.0, np.minimum(rest, depth))
    E = sp.csc_array(stiffness * matrices.M + matrices.N)
    x, y, z = (sp.csc_array(sp.diags_array(ahead[:, j]) @ E @ sp.diags_array(ahead[:, j])) for j in range(3))
    gradient = -((E @ way) * ahead).sum(1)
    rows = LinearLimits(sp.eye_array(len(P), format="csr"), np.zeros(len(P)), most)
    found = np.clip(solve_qp(sp.csc_array(x + y + z), gradient, rows, SOLVER_TOLERANCE).x, 0.0, most)
    return np.asarray(found[:, None] * ahead)


def _level(k: int, before: TSpline, surface: TSpline, grid: _Grid, limit: float, stock: OpenStock) -> Level:
    """One cut measured on the surfaces: depth both ways, nesting along the outer level's normals,
    self-intersections."""
    inner, outer, inside, outside = (
        grid.mesh(before),
        grid.mesh(surface),
        grid.points(before),
        grid.points(surface),
    )
    depth, back, gap = (
        distances(*each, grid.all) for each in ((before, outside), (surface, inside), (stock.surface, inside))
    )
    closest, face = exact_closest(outer, inside)
    normals = outer.face_vectors[face] / lengths(outer.face_vectors[face])[:, None]
    ahead = -stock.side * dots(inside - closest, normals)
    behind = np.flatnonzero(ahead < 0)
    feet = surface.project(inside[behind])
    ahead[behind] = -stock.side * dots(inside[behind] - feet.points, surface.normals(*feet.parameters.T))
    cuts = self_intersections(outer)
    for worst, trouble, place in (
        (
            float(depth.max()) - limit - DEPTH_TOLERANCE,
            f"is {depth.max():.4f} mm deep, more than {limit} mm,",
            outside[np.argmax(depth)],
        ),
        (
            float(back.max()) - limit - DEPTH_TOLERANCE,
            f"is {back.max():.4f} mm deep, more than {limit} mm,",
            inside[np.argmax(back)],
        ),
        (
            float(-ahead.min()) - NEST_TOLERANCE,
            f"falls {-ahead.min():.4f} mm behind the level before",
            inside[np.argmin(ahead)],
        ),
        (
            float(len(cuts)),
            f"cuts itself in {len(cuts)} faces",
            outer.vertices[outer.faces[cuts[0] if len(cuts) else 0]].mean(0),
        ),
    ):
        if worst > 0:
            told = f"level {k} {trouble} at {place_name(place)}: give a higher stiffness or other edges"
            raise LevelError(told, level=k, place=place, patch=patch_of(outer, place))
    count, area, inner_area = (
        len(outer.vertices),
        lengths(outer.face_vectors) / 2,
        lengths(inner.face_vectors) / 2,
    )
    full = gap[count:] >= REMAINS * limit
    return Level(
        k,
        surface,
        outer,
        limit,
        float(depth.max()),
        float(np.average(depth[count:], weights=area)),
        float(ahead.min()),
        len(cuts),
        depth_back_max=float(back.max()),
        full_mean=float(np.average(back[count:][full], weights=inner_area[full])) if full.any() else limit,
        histogram=tuple(
            float(v)
            for v in np.histogram(depth[count:], bins=BINS, range=(0, limit), weights=area / area.sum())[0]
        ),
        full_area=float(inner_area[full].sum()),
    )
