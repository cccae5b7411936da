"""Taking knots out of a row-structured T-mesh again where the fit can spare them.

For each s-knot of each row the curve Q_j is fitted without it; the change, blended with N_j, moves the
surface at the samples. A knot is spared where no sample's distance along the normal would pass the limit;
those that raise it least go first, and of neighbouring knots only one.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.surface.basis.periodic import FEWEST, collocation
from bonecam.surface.fitting.target import FitTarget
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

WIDEST = 0.25
"""The widest gap between knots, in turns, of a row next to a pole: round a wider one the surface folds at the
pole."""


@dataclass(frozen=True, eq=False)
class Spared:
    """A knot of a row, the samples its lack moves, how far along their normals, and the distance that
    makes."""

    row: int
    knot: int
    samples: Int[ndarray, " k"]
    moves: Float[ndarray, " k"]
    worst: float


def prune(surface: TSpline, target: FitTarget, limit: float, most: int) -> RowTMesh:
    """The T-mesh without at most `most` knots, no sample's distance being expected to pass `limit` (mm) for
    their lack."""
    tmesh = surface.tmesh
    assert isinstance(tmesh, RowTMesh)
    now, spared = spare_knots(surface, target)
    removable = [one for one in spared if one.worst < limit]
    gone: list[set[int]] = [set() for _ in tmesh.s_knots]
    for one in sorted(removable, key=lambda one: (one.worst, one.row, one.knot)):
        count = len(tmesh.s_knots[one.row])
        near = {(one.knot + d) % count for d in (-2, -1, 0, 1, 2)}
        if sum(map(len, gone)) >= most or near & gone[one.row] or count - len(gone[one.row]) <= FEWEST:
            continue
        if (
            one.row in (1, len(gone) - 2)
            and _widest(np.delete(tmesh.s_knots[one.row], [*gone[one.row], one.knot])) > WIDEST
        ):
            continue
        then = now[one.samples] + one.moves
        if len(then) == 0 or np.abs(then).max() < limit:
            gone[one.row].add(one.knot)
            now[one.samples] = then
    return RowTMesh.from_rows(tmesh.t_knots, [np.delete(knots, sorted(g)) for knots, g in zip(tmesh.s_knots, gone)])


def _widest(knots: Float[ndarray, " k"]) -> float:
    """The widest gap of a row's knots, in turns."""
    return float(np.diff(knots, append=knots[0] + 1).max())


def spare_knots(surface: TSpline, target: FitTarget) -> tuple[Float[ndarray, " n"], list[Spared]]:
    """The signed distances of the samples now, and what the lack of each knot would do; rows with the fewest
    knots have none to spare."""
    samples = target.inward
    normals = surface.normals(samples.s, samples.t)
    now = dots(surface.positions(samples.s, samples.t) - samples.points, normals)
    basis = sp.csc_array(surface.basis(samples.s, samples.t)[0])
    return now, [
        one for row in range(len(surface.tmesh.row_starts) - 1) for one in _row(surface, basis, normals, now, row)
    ]


def _row(surface: TSpline, basis: sp.csc_array, normals: ndarray, now: ndarray, row: int) -> list[Spared]:
    """All knots of one row."""
    tmesh = surface.tmesh
    assert isinstance(tmesh, RowTMesh)
    knots = tmesh.s_knots[row]
    start = int(tmesh.row_starts[row])
    if len(knots) <= FEWEST:
        return []
    points = surface.control_points[start : start + len(knots)]
    part = sp.csr_array(basis[:, start : start + len(knots)])
    moved = np.flatnonzero(np.diff(part.indptr))
    part = part[moved]
    whole = la.inv(collocation(knots, knots))
    spared = []
    for k in range(len(knots)):
        matrix = whole @ collocation(np.delete(knots, k), knots)
        change = matrix @ la.lstsq(matrix, points)[0] - points
        moves = dots(part @ change, normals[moved])
        felt = np.abs(moves) > 1e-3 * np.abs(moves).max(initial=0.0)
        worst = np.abs(now[moved[felt]] + moves[felt]).max(initial=0.0)
        spared.append(Spared(row, k, moved[felt], moves[felt], float(worst)))
    return spared
