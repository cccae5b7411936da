"""Fitting a row-structured T-spline to a mesh: few control points, put only where the mesh would be missed.

The start is a coarse surface through the loops of the mesh's harmonic field, which give every mesh sample its first foot. It is drawn to
the samples (`steps`); then, round by round, knots are added where samples are missed (`adapt`) until all are within the tolerance or the
control points are spent.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.sections import Rows
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report, silent
from bonecam.surface.adapt import Votes, miss_votes, refine
from bonecam.surface.deviation import Deviation, measure
from bonecam.surface.fairness import gauss_points
from bonecam.surface.periodic import FEWEST
from bonecam.surface.quadratic import Term, least
from bonecam.surface.steps import LEAST_FACING, fold_grid, step
from bonecam.surface.target import Target
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

SAMPLES = 6000  # of the mesh, besides its vertices
ROUGH_SHARE = 0.6  # of the control points may be spent on a first surface without folds
LOOSE_PLANE, PLANE = 0.3, 1000.0  # weight of the poles' planes, times the mean area of a control point: as it grows, and at last
ROUNDS, LAST_ROUNDS = 2, 4  # steps after each refinement, and at last
GOAL = 0.95  # of the tolerance: no sample may be farther
CHECKS = 8  # dense measurements, each followed by more samples where the mesh is missed
FIRST = ((150, 9, 10), (40, 5, 6))  # from so many control points allowed: spans and knots a row of the first T-mesh
Refine = Callable[[RowTMesh, Votes, int], RowTMesh]
"""A finer T-mesh from the votes for it and the number of control points it may have more."""


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


def fit(
    rows: Rows, mesh: TriangleMesh, tolerance: float, max_control_points: int, progress: Progress = silent, refine: Refine = refine
) -> Fit:
    """The T-spline within `tolerance` (mm, both ways) of `mesh`, or as near as `max_control_points` allow: see `Fit.reached`.

    `rows` are sections of (a remeshed copy of) the mesh from the lower to the upper pole; at least 40 control points.
    """
    if not tolerance > 0 or max_control_points < FIRST[-1][0]:
        raise ValueError(f"tolerance {tolerance}, {max_control_points} control points: give a length above 0 and {FIRST[-1][0]} or more")
    target = Target.of(mesh, rows, SAMPLES)
    spans, knots = next(first[1:] for first in FIRST if first[0] <= max_control_points)
    surface, target = first_surface(rows, target, tolerance, max_control_points, first_tmesh(spans, knots), refine)
    surface, target = settle(surface, target, tolerance, ROUNDS)
    for _ in range(CHECKS):
        surface, target = grown(surface, target, tolerance, max_control_points, progress, refine)
        measured = measure(surface, mesh, target.shape.distance)
        missed = measured.missed(tolerance)
        if not len(missed) or surface.tmesh.size >= max_control_points:
            break
        target = target.with_points(missed, surface)
    folded = target.shape.facing(surface, *fold_grid(surface)).min() < 0
    found = measured.deviation
    return Fit(surface, found, tolerance, found.max <= tolerance and not folded)


def grown(
    surface: TSpline, target: Target, tolerance: float, max_control_points: int, progress: Progress, refine: Refine
) -> tuple[TSpline, Target]:
    """Refined where samples are missed until none is or the control points are spent, and settled with plane poles."""
    while target.worst > GOAL * tolerance and surface.tmesh.size < max_control_points:
        size, worst = surface.tmesh.size, target.worst
        report(progress, size / max_control_points, f"{size} control points, {worst:.3f} mm")
        samples = target.all
        votes = miss_votes(surface, samples.s, samples.t, samples.distances, samples.areas, GOAL * tolerance)
        assert isinstance(surface.tmesh, RowTMesh)
        tmesh = refine(surface.tmesh, votes, max_control_points - size)
        if tmesh.size == size:
            break
        surface = moved(surface, tmesh)
        surface, target = settle(surface, target.on(surface, tolerance), tolerance, ROUNDS)
    return settle(surface, target, tolerance, LAST_ROUNDS, PLANE)


def first_surface(
    rows: Rows, target: Target, tolerance: float, max_control_points: int, tmesh: RowTMesh, refine: Refine
) -> tuple[TSpline, Target]:
    """A coarse surface with the parameters of the rows, and the feet on it; its T-mesh grows until nothing folds."""
    while True:
        surface = through_loops(rows, tmesh)
        found = target.on(surface, tolerance)
        if target.shape.facing(surface, *fold_grid(surface)).min() > LEAST_FACING:
            break
        samples = found.all
        votes = miss_votes(surface, samples.s, samples.t, samples.distances, samples.areas, tolerance)
        finer = refine(tmesh, votes, round(ROUGH_SHARE * max_control_points) - tmesh.size)
        if finer.size == tmesh.size:
            break
        tmesh = finer
    return surface, found


def through_loops(rows: Rows, tmesh: RowTMesh) -> TSpline:
    """The surface that meets the rows' loops and poles best, each at its parameters."""
    loops, count = rows.guides.shape[:2]
    share = np.arange(1, loops + 1) * (len(rows.heights) + 1) / (loops + 1)
    heights = np.interp(share, np.arange(len(rows.heights) + 2), [0.0, *rows.heights, 1.0])
    s, t = np.tile(np.arange(count) / count, loops), np.repeat(heights, count)
    weights = np.repeat(np.gradient(heights), count)
    basis = tmesh.blending(np.append(s, [0.0, 0.0]), np.append(t, [0.0, 1.0]), 0)[0]
    weighted = sp.diags_array(np.append(weights, [1.0, 1.0])) @ basis
    normal = (basis.T @ weighted).toarray() + 1e-9 * np.eye(tmesh.size)
    points = np.vstack([rows.guides.reshape(-1, 3), rows.poles])
    return TSpline(tmesh, np.linalg.solve(normal, weighted.T @ points), np.ones(tmesh.size))


def first_tmesh(spans: int, knots: int) -> RowTMesh:
    """Even spans in t, `knots` even knots a row, four in the rows next to the poles."""
    t_knots = np.concatenate([np.zeros(3), np.linspace(0, 1, spans + 1), np.ones(3)])
    rows = [np.arange(knots) / knots for _ in range(spans + 3)]
    rows[0] = rows[-1] = np.zeros(1)
    rows[1] = rows[-2] = np.arange(FEWEST) / FEWEST
    return RowTMesh.from_rows(t_knots, rows)


def moved(surface: TSpline, tmesh: RowTMesh) -> TSpline:
    """A surface on `tmesh` like `surface`: least squares in the Gauss points, faintly held at the anchors."""
    size = tmesh.size
    draft = TSpline(tmesh, surface.positions(*anchors(tmesh)), np.ones(size))
    s, t, share = gauss_points(draft)
    data = Term(draft.basis(s, t)[0], share[:, None, None] * np.eye(3), surface.positions(s, t))
    held = Term(sp.eye_array(size, format="csr"), np.broadcast_to(1e-6 / size * np.eye(3), (size, 3, 3)), draft.control_points)
    return TSpline(tmesh, least([data, held], size), np.ones(size))


def anchors(tmesh: RowTMesh) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """(s, t) of each control point: its knot and its row's Greville point."""
    t = [tmesh.t_knots[j + 1 : j + 4].mean() for j in range(len(tmesh.s_knots))]
    return np.concatenate(tmesh.s_knots), np.repeat(t, [len(row) for row in tmesh.s_knots])


def settle(surface: TSpline, target: Target, tolerance: float, rounds: int, plane: float = LOOSE_PLANE) -> tuple[TSpline, Target]:
    """`rounds` steps with the feet followed after each."""
    for _ in range(rounds):
        surface = step(surface, target, tolerance, plane)
        target = target.on(surface, tolerance)
    return surface, target
