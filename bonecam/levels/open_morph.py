"""The morph of an open surface (a blade): level 0 is the surface, the last level its stock, an offset of it or a given surface.

An open surface has no inside, so the stock is a surface too, fitted over the same T-mesh: control points Q for the part's P. A level
solves the published energy (Gan et al. 2014, section 4.2) with the stock's own points as source of attraction,

    min  c_int (P + x - Q)' M (P + x - Q) + c_ext int |R (P + x - Q)|^2      s.t. 0 <= x_i <= eps_k on the way from P_i to Q_i,

every control point on its straight way: the blending functions are non-negative and sum to one, so that no point of the surface
moves further than eps_k, and none falls behind where the ways lie on the outer side. A given stock is met at its nearest points.
Fixed edges keep their control points: all levels hang on the part's edges, and the stock bends down to them.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.errors import JobError, LevelError, StockError, SurfaceError, place_name
from bonecam.levels.check import BINS, DEPTH_TOLERANCE, NEST_TOLERANCE, patch_of
from bonecam.levels.level import Level
from bonecam.levels.morph import Morph
from bonecam.levels.schedule import Schedule
from bonecam.levels.solve import Rows, factor, solve
from bonecam.mesh.distance import MeshDistance, exact_closest
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report, silent
from bonecam.surface.tspline import TSpline

EDGES = ("free", "fixed")
GAUSS, BORDER, ON_BORDER = 4, 400, 1e-6
STIFFNESS, FIT_STIFFNESS = 1e-9, 1e-8
CHORD, SOLVER_TOLERANCE = 0.01, 2e-6


@dataclass(frozen=True, eq=False)
class _Fabric:
    """Matrices of one surface over its own Bezier elements: Gauss samples, the thin plate M and int R'R, and the edges' control points."""

    R: sp.csr_array
    weights: Float[ndarray, " n"]
    normals: Float[ndarray, "n 3"]
    M: sp.csc_array
    N: sp.csc_array
    edge: Bool[ndarray, " c"]


def morph_open(
    surface: TSpline,
    stock: float | TriangleMesh | TSpline,
    schedule: Schedule,
    *,
    edges: str = "free",
    stiffness: float = STIFFNESS,
    chord_tolerance: float = 0.01,
    progress: Progress = silent,
) -> Morph:
    """All levels from an open surface to its stock: so many mm along its normals (negative: behind it), or a given surface on one side.

    `edges`: `free`, or `fixed` to those of the part. Raises SurfaceError where the surface is closed, JobError where `edges` is neither,
    StockError where the stock does not lie on one side of the part, LevelError where a level cannot be made or fails its check.
    """
    if edges not in EDGES:
        raise JobError(f"edges = {edges!r}: choose one of {', '.join(EDGES)}", field="edges")
    if all(surface.poles) or all(surface.elements().period):
        raise SurfaceError("the surface is closed: morph it into a stock with bonecam.levels.rounding.levels_in(surface, stock, schedule)")
    fabric = _fabric(surface)
    held = fabric.edge & (edges == "fixed")
    target, side = _target(surface, fabric, stock, held)
    finer = max((each.tessellate_with_parameters(chord_tolerance) for each in (surface, target)), key=lambda found: len(found.mesh.faces))
    grid = _Grid(finer.parameters, _middles(finer.parameters, finer.mesh.faces, surface.elements().period), finer.mesh.faces)
    stock_points = grid.points(target)
    distance = _farthest(grid.mesh(surface), stock_points)
    lower_bound = schedule.lower_bound(distance)
    made = [np.array(surface.control_points)]
    while _farthest(grid.mesh(surface.with_control_points(made[-1])), stock_points) > schedule.limit(len(made)):
        k = len(made)
        report(progress, min(1.0, k / lower_bound), f"level {k}")
        moves = _moves(fabric, made[-1], target.control_points, schedule.limit(k), stiffness, held)
        if np.linalg.norm(moves, axis=1).max() < schedule.limit(k) / 100:
            raise LevelError(f"level {k} gets no nearer to the stock: give a lower stiffness", level=k)
        made.append(made[-1] + moves)
    shapes = [*(surface.with_control_points(P) for P in made), target]
    levels = [Level(0, surface, mesh := grid.mesh(surface), 0.0, 0.0, 0.0, 0.0, len(self_intersections(mesh)))]
    levels += [_level(k, inner, outer, grid, schedule.limit(k), side) for k, (inner, outer) in enumerate(pairwise(shapes), start=1)]
    levels[-1] = replace(levels[-1], surface=None)
    return Morph(tuple(levels), lower_bound, distance, 0.0, 0.0)


def _farthest(mesh: TriangleMesh, points: ndarray) -> float:
    """The largest distance from the points to a level, mm."""
    return float(MeshDistance(mesh).unsigned(points).max())


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
        return surface.positions(*np.vstack([self.parameters, self.middles]).T)


def _middles(parameters: ndarray, faces: ndarray, period: tuple[float, float]) -> Float[ndarray, "f 2"]:
    """(s, t) in the middle of each face, also where it lies across a seam."""
    first, turn = parameters[faces[:, 0]], np.array(period)
    offset = parameters[faces] - first[:, None]
    offset -= turn * np.round(offset / np.where(turn > 0, turn, 1.0))
    return np.asarray(first + offset.mean(1))


def _fabric(surface: TSpline) -> _Fabric:
    boxes = surface.elements().boxes
    x, w = np.polynomial.legendre.leggauss(GAUSS)
    low, size = boxes[:, [0, 2]], boxes[:, [1, 3]] - boxes[:, [0, 2]]
    u, v = (k.ravel() for k in np.meshgrid((x + 1) / 2, (x + 1) / 2))
    s, t = (low[:, i : i + 1] + size[:, i : i + 1] * part for i, part in ((0, u), (1, v)))
    weights = (np.outer(size.prod(1), np.outer(w, w).ravel() / 4)).ravel()
    R, R_s, R_t, ss, st, tt = surface.basis(s.ravel(), t.ravel(), 2)
    W = sp.diags_array(weights)
    M = sp.csc_array(ss.T @ W @ ss + 2 * (st.T @ W @ st) + tt.T @ W @ tt)
    n = np.cross(R_s @ surface.control_points, R_t @ surface.control_points)
    normals = n / np.linalg.norm(n, axis=1, keepdims=True)
    return _Fabric(R, weights, normals, M, sp.csc_array(R.T @ W @ R), _on_edge(surface))


def _on_edge(surface: TSpline) -> Bool[ndarray, " c"]:
    """Control points that move an edge of the surface."""
    ends = surface.domain
    period, reached = surface.elements().period, np.zeros(surface.tmesh.size)
    for across in (0, 1):
        if period[across]:
            continue
        along = np.linspace(ends[1 - across, 0], ends[1 - across, 1], BORDER)
        for end in ends[across]:
            pair = (np.full(BORDER, end), along) if across == 0 else (along, np.full(BORDER, end))
            reached = np.maximum(reached, surface.basis(*pair)[0].max(axis=0).toarray().ravel())
    return np.asarray(reached > ON_BORDER)


def _target(surface: TSpline, fabric: _Fabric, stock: Any, held: ndarray) -> tuple[TSpline, float]:
    """The stock over the part's T-mesh by least squares, and on which side it lies (1: where the normals point)."""
    points = fabric.R @ surface.control_points
    if isinstance(stock, int | float):
        if not (np.isfinite(stock) and stock != 0):
            raise StockError(f"an offset of {stock} mm is no stock: give a distance above or below zero", distance=float(stock))
        wanted, side = points + float(stock) * fabric.normals, float(np.sign(stock))
    else:
        wanted, _ = exact_closest(stock if isinstance(stock, TriangleMesh) else stock.tessellate(CHORD), points)
        side = float(np.sign(np.median(((wanted - points) * fabric.normals).sum(1)))) or 1.0
    fit = factor(fabric.N + FIT_STIFFNESS * fabric.M)
    way = fit.solve(np.asarray(fabric.R.T @ (fabric.weights[:, None] * (wanted - points))))
    Q = surface.control_points + np.where(held[:, None], 0.0, way)
    ahead = side * (((fabric.R @ Q) - points) * fabric.normals).sum(1)
    worst = int(np.argmin(ahead))
    if ahead[worst] < -NEST_TOLERANCE:
        raise StockError(
            f"the stock lies {-ahead[worst]:.3f} mm behind the part at {place_name(points[worst])}: give one on one side of it",
            distance=float(-ahead[worst]),
            place=points[worst],
        )
    return surface.with_control_points(Q), side


def _moves(fabric: _Fabric, P: ndarray, Q: ndarray, depth: float, stiffness: float, held: ndarray) -> ndarray:
    """The level's program: how far every control point goes on its straight way to its target."""
    way = Q - P
    rest = np.linalg.norm(way, axis=1)
    ahead = way / np.where(rest > 0, rest, 1.0)[:, None]
    most = np.where(held, 0.0, np.minimum(rest, depth))
    E = sp.csc_array(stiffness * fabric.M + fabric.N)
    x, y, z = (sp.csc_array(sp.diags_array(ahead[:, j]) @ E @ sp.diags_array(ahead[:, j])) for j in range(3))
    gradient = -((E @ way) * ahead).sum(1)
    rows = Rows(sp.eye_array(len(P), format="csr"), np.zeros(len(P)), most)
    found = np.clip(solve(sp.csc_array(x + y + z), gradient, rows, SOLVER_TOLERANCE).x, 0.0, most)
    return np.asarray(found[:, None] * ahead)


def _level(k: int, before: TSpline, surface: TSpline, grid: _Grid, limit: float, side: float) -> Level:
    """One cut measured: depth both ways, nesting along the outer level's normals, self-intersections.

    Nearest places are found on the meshes; where a limit seems broken, on the surfaces.
    """
    inner, outer, inside, outside = grid.mesh(before), grid.mesh(surface), grid.points(before), grid.points(surface)
    depth = MeshDistance(inner).unsigned(outside)
    deep = np.flatnonzero(depth > limit)
    depth[deep] = np.minimum(depth[deep], before.project(outside[deep]).distances)
    closest, face = exact_closest(outer, inside)
    away = inside - closest
    normals = outer.face_vectors[face] / np.linalg.norm(outer.face_vectors[face], axis=1, keepdims=True)
    ahead = -side * (away * normals).sum(1)
    behind = np.flatnonzero(ahead < 0)
    feet = surface.project(inside[behind])
    ahead[behind] = -side * ((inside[behind] - feet.feet) * surface.normals(*feet.parameters.T)).sum(1)
    area = np.linalg.norm(outer.face_vectors, axis=1)
    middles = depth[len(outer.vertices) :]
    cuts = self_intersections(outer)
    for worst, trouble, place in (
        (float(depth.max()) - limit - DEPTH_TOLERANCE, f"is {depth.max():.4f} mm deep, more than {limit} mm,", outside[np.argmax(depth)]),
        (float(-ahead.min()) - NEST_TOLERANCE, f"falls {-ahead.min():.4f} mm behind the level before", inside[np.argmin(ahead)]),
        (float(len(cuts)), f"cuts itself in {len(cuts)} faces", outer.vertices[outer.faces[cuts[0] if len(cuts) else 0]].mean(0)),
    ):
        if worst > 0:
            told = f"level {k} {trouble} at {place_name(place)}: give a higher stiffness or other edges"
            raise LevelError(told, level=k, place=place, patch=patch_of(outer, place))
    return Level(
        k,
        surface,
        outer,
        limit,
        float(depth.max()),
        float(np.average(middles, weights=area)),
        float(ahead.min()),
        len(cuts),
        depth_back_max=float(np.linalg.norm(away, axis=1).max()),
        full_mean=float(np.average(middles, weights=area)),
        histogram=tuple(float(v) for v in np.histogram(middles, bins=BINS, range=(0, limit), weights=area / area.sum())[0]),
    )
