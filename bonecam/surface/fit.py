"""Fitting a row-structured T-spline to a mesh: few control points, put only where the mesh would be missed.

The start is the skinned surface: it gives every mesh sample its first foot. A coarse T-mesh is fitted to the samples; then, round by round,
knots are added where the samples are missed (`adapt`) until all are within the tolerance or the control points are spent.

One step solves for all control points, with the feet (s, t) and normals n of the surface before,

    min sum_i w_i [ (n_i . (S(s_i, t_i) - X_i))^2 + slide |S(s_i, t_i) - X_i|^2 ] + fairness + poles,

the tangent-distance step (Wang, Pottmann & Liu 2006): samples may slide in the tangent plane at little cost, so the parameters
follow the shape and steps converge in few rounds. w_i grows with the miss, which trades a little of the rms for the maximum. The row
next to a pole is kept in one plane with it.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.sections import Rows
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, part, report, silent
from bonecam.surface.adapt import miss_votes, refine
from bonecam.surface.deviation import Deviation, deviation
from bonecam.surface.fairness import fairness
from bonecam.surface.feet import follow, nearest_on_grid
from bonecam.surface.periodic import FEWEST
from bonecam.surface.quadratic import Quadratic
from bonecam.surface.samples import sample_mesh
from bonecam.surface.skin import skin
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

SAMPLES = 6000  # of the mesh, besides its vertices
SLIDE = 0.1  # weight of a miss in the tangent plane
BEND, DRIFT = 2e-5, 3e-2  # fairness, times (mean cell side)^4
FIRMNESS = (1.0, 30.0, 1000.0)  # of the fairness, tried until nothing folds
LEAST_TURN, LEAST_FACING = 0.5, 0.2  # cosines
FIRST = ((6, 8), (12, 12), (20, 12))  # spans and knots a row of the first T-mesh, tried in turn
ROUGH = 3.0  # how near the skinned surface the first surface has to be, in tolerances
GOOD_ENOUGH = 1.5  # tolerances; an unfolded fit within them is not tried again from a finer start
ROUGH_SHARE = 0.6  # of the control points may be spent on that
PLANE = 100.0  # weight of the poles' planes, times the mean area of a control point


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted surface and how far it is from the mesh; `reached` says whether that is within the tolerance asked for."""

    surface: TSpline
    deviation: Deviation
    tolerance: float
    reached: bool

    @property
    def control_points(self) -> int:
        """Number of control points."""
        return self.surface.tmesh.size


class Shape:
    """The mesh, asked for the normal nearest to a point."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self._distance = MeshDistance(mesh)
        self._normals = mesh.face_vectors / np.maximum(np.linalg.norm(mesh.face_vectors, axis=1, keepdims=True), np.finfo(float).tiny)

    def facing(self, surface: TSpline, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> float:
        """The least cosine between a surface normal and that of the mesh's nearest face."""
        points = surface.evaluate(s, t, 1)[0]
        _, faces = self._distance.closest(points)
        return float(np.einsum("ij,ij->i", surface.normals(s, t), self._normals[faces]).min())


@dataclass(frozen=True, eq=False)
class Target:
    """Samples of the mesh with their areas, and where their feet are now."""

    shape: Shape
    points: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    s: Float[ndarray, " n"]
    t: Float[ndarray, " n"]
    distances: Float[ndarray, " n"]

    def on(self, surface: TSpline, anew: bool = False) -> "Target":
        """With the feet on `surface`: found again, or followed from where they were."""
        s, t = nearest_on_grid(surface, self.points) if anew else (self.s, self.t)
        return Target(self.shape, self.points, self.areas, *follow(surface, self.points, s, t, rounds=3))


def fit(rows: Rows, mesh: TriangleMesh, tolerance: float, max_control_points: int, progress: Progress = silent) -> Fit:
    """The T-spline within `tolerance` (mm, both ways) of `mesh`, or as near as `max_control_points` allow: see `Fit.reached`.

    `rows` are sections of (a remeshed copy of) the mesh from the lower to the upper pole; at least 40 control points.
    """
    skinned = skin(rows.points, tolerance, poles=rows.poles)
    points, areas = sample_mesh(mesh, SAMPLES)
    empty = np.zeros(len(points))
    target = Target(Shape(mesh), points, areas, empty, empty, empty).on(skinned, anew=True)
    found: list[tuple[bool, float, int, Fit]] = []
    for number, first in enumerate(FIRST):
        if number and first_tmesh(*first).size > ROUGH_SHARE * max_control_points:
            break
        share = part(progress, number / len(FIRST), (number + 1) / len(FIRST))
        surface = attempt(skinned, target, tolerance, max_control_points, first_tmesh(*first), share)
        measured = deviation(surface, mesh)
        folded = target.shape.facing(surface, *fold_grid()) < 0
        found.append((folded, measured.max, number, Fit(surface, measured, tolerance, measured.max <= tolerance and not folded)))
        if not folded and measured.max <= GOOD_ENOUGH * tolerance:
            break
    return min(found, key=lambda one: one[:3])[3]


def attempt(skinned: TSpline, target: Target, tolerance: float, max_control_points: int, tmesh: RowTMesh, progress: Progress) -> TSpline:
    """One fit from the first T-mesh given."""
    surface, target = first_surface(skinned, target, tolerance, max_control_points, tmesh)
    surface, target = settle(surface, target, tolerance, 2)
    while target.distances.max() > 0.9 * tolerance and surface.tmesh.size < max_control_points:
        size, worst = surface.tmesh.size, float(target.distances.max())
        report(progress, size / max_control_points, f"{size} control points, {worst:.3f} mm")
        votes = miss_votes(surface, target.s, target.t, target.distances, target.areas, tolerance)
        assert isinstance(surface.tmesh, RowTMesh)
        tmesh = refine(surface.tmesh, votes, max_control_points - size)
        if tmesh.size == size:
            break
        surface = step(moved(surface, tmesh), target, tolerance, slide=1.0)
        surface, target = settle(surface, target.on(surface, anew=True), tolerance, 2)
    return settle(surface, target, tolerance, 6)[0]


def first_surface(skinned: TSpline, target: Target, tolerance: float, max_control_points: int, tmesh: RowTMesh) -> tuple[TSpline, Target]:
    """A coarse surface with the parameters of the skinned one, and the feet on it.

    The T-mesh grows where the mesh is missed until nothing folds and the worst miss is within ROUGH tolerances of the skinned surface's.
    """
    enough = ROUGH * tolerance + float(target.distances.max())
    while True:
        surface = moved(skinned, tmesh)
        found = target.on(surface, anew=True)
        if found.distances.max() < enough and not folds(surface, skinned, target.shape):
            break
        votes = miss_votes(surface, found.s, found.t, found.distances, found.areas, tolerance)
        finer = refine(tmesh, votes, round(ROUGH_SHARE * max_control_points) - tmesh.size)
        if finer.size == tmesh.size:
            break
        tmesh = finer
    return surface, found


def first_tmesh(spans: int, knots: int) -> RowTMesh:
    """Even spans in t, `knots` even knots a row, four in the rows next to the poles."""
    t_knots = np.concatenate([np.zeros(3), np.linspace(0, 1, spans + 1), np.ones(3)])
    rows = [np.arange(knots) / knots for _ in range(spans + 3)]
    rows[0] = rows[-1] = np.zeros(1)
    rows[1] = rows[-2] = np.arange(FEWEST) / FEWEST
    return RowTMesh.from_rows(t_knots, rows)


def moved(surface: TSpline, tmesh: RowTMesh) -> TSpline:
    """A surface on `tmesh` like `surface`: least squares on a grid of surface points."""
    s, t = (v.ravel() for v in np.meshgrid(np.arange(80) / 80, np.linspace(0, 1, 121)))
    basis = tmesh.blending(s, t, 0)[0]
    size = tmesh.size
    normal = (basis.T @ basis).toarray() + 1e-9 * np.eye(size)
    return TSpline(tmesh, np.linalg.solve(normal, basis.T @ surface.evaluate(s, t)), np.ones(size))


def settle(surface: TSpline, target: Target, tolerance: float, rounds: int) -> tuple[TSpline, Target]:
    """`rounds` steps with the feet followed after each."""
    for _ in range(rounds):
        surface = step(surface, target, tolerance, SLIDE)
        target = target.on(surface)
    return surface, target


def step(surface: TSpline, target: Target, tolerance: float, slide: float) -> TSpline:
    """The solved surface; where that folds, one solved with more fairness, or only a part of the way there."""
    found = surface
    for firmness in FIRMNESS:
        found = solved(surface, target, tolerance, slide, firmness)
        if not folds(found, surface, target.shape):
            return found
    for share in (0.5, 0.25, 0.1):
        nearer = surface.with_control_points((1 - share) * surface.control_points + share * found.control_points)
        if not folds(nearer, surface, target.shape):
            return nearer
    return surface


def fold_grid() -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s and t of a grid that crowds at the poles."""
    s, t = np.meshgrid(np.arange(48) / 48, (1 - np.cos(np.linspace(0.06, np.pi - 0.06, 64))) / 2)
    return s.ravel(), t.ravel()


def folds(surface: TSpline, before: TSpline, shape: Shape) -> bool:
    """Whether a normal on a grid that crowds at the poles turned too far from what it was before, or away from the mesh's."""
    s, t = fold_grid()
    if np.einsum("ij,ij->i", surface.normals(s, t), before.normals(s, t)).min() < LEAST_TURN:
        return True
    facing = shape.facing(surface, s, t)
    return facing < LEAST_FACING and facing < shape.facing(before, s, t)


def solved(surface: TSpline, target: Target, tolerance: float, slide: float, firmness: float) -> TSpline:
    """One step: the best control points for the feet, normals and lengths of now."""
    (basis,) = surface.basis(target.s, target.t)
    normals = surface.normals(target.s, target.t)
    level = max(tolerance, 0.5 * float(target.distances.max()))
    weights = target.areas * (0.25 + (target.distances / level) ** 2)
    metric = weights[:, None, None] * (slide * np.eye(3) + (1 - slide) * normals[:, :, None] * normals[:, None, :])
    cell = target.areas.sum() / surface.tmesh.size
    form = Quadratic.zero(surface.tmesh.size).plus(basis, metric, target.points)
    form = form + fairness(surface, firmness * BEND * cell**2, firmness * DRIFT * cell**2) + pole_planes(surface, PLANE * cell)
    return surface.with_control_points(form.least())


def pole_planes(surface: TSpline, weight: float) -> Quadratic:
    """Keeps the control points next to each pole in one plane with it, the plane that fits them now."""
    starts = surface.tmesh.row_starts
    form = Quadratic.zero(surface.tmesh.size)
    for pole, ring in ((0, np.arange(starts[1], starts[2])), (starts[-1] - 1, np.arange(starts[-3], starts[-2]))):
        arms = surface.control_points[ring] - surface.control_points[pole]
        normal = np.linalg.svd(arms)[2][2]
        ones = np.ones(len(ring))
        index = np.arange(len(ring))
        shape = (len(ring), surface.tmesh.size)
        matrix = sp.csr_array((ones, (index, ring)), shape=shape) - sp.csr_array((ones, (index, np.full(len(ring), pole))), shape=shape)
        form = form.plus(
            sp.csr_array(matrix), np.broadcast_to(weight * np.outer(normal, normal), (len(ring), 3, 3)), np.zeros((len(ring), 3))
        )
    return form
