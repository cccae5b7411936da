"""Skinning: one T-spline through rows of points.

Rows of points as cubic section curves: parameters by chord length, an interpolating curve for each row,
all on shared knots.

Rows with equal counts share the mean of their parameters (their columns belong together); rows with different
counts have each its own, rounded to a common grid where that keeps them apart, so that few distinct knots
come together.

Skinning: one row-structured T-spline through section curves (Yang & Zheng 2012; Gan et al. 2014, section
3.2).

Every row of points is interpolated by a C2 cubic, closed or open, on its own parameters. The sections are
interpolated along t by a clamped cubic: the control curves Q_j come from one banded system,

    a_j Q_{j-1} + b_j Q_j + c_j Q_{j+1} = C_{j-1},   Q_1 = C_1,   Q_last = C_last.

Rows without poles: as many control curves as sections, t-knots by averaging; fewer than four sections get
natural ends. Poles are sections that shrank to a point; each adds a control curve and an end condition. The
published one is the natural end (S_tt = 0), which makes a cone of the pole. A closed bone is smooth there: a
meridian s runs on as the meridian s + 1/2. So the part of Q_2 that is even under s -> s + 1/2 lies in the
pole (S_t = 0), and only the odd part has S_tt = 0.

Each control curve then keeps its own fewest knots (`reduction`); since the t-functions are non-negative and
sum to one, no point of the surface moves further than the worst control curve does.

Knot reduction with a guaranteed bound: the fewest knots a curve keeps within a tolerance (Yang & Zheng
2012, section 4).

Start from the fewest knots, insert a knot where the error is largest until it is below the tolerance; then
take knots out again, the least needed one first, as long as the tolerance holds: an early knot is often
spared by later ones. The error is not sampled: it is the largest control point of the difference curve on
fine knots, which bounds the difference everywhere.

The surface through an open mesh of one piece with four corners, such as the side of a blade.

The mesh is laid out on a rectangle whose sides are the four runs of its edge between the corners: a harmonic map
(Eck et al. 1995). Rows of points at equal distances in the rectangle are skinned like rows from a file, and as many of
them are taken as bring the surface near enough to the mesh, and the mesh to it.

Rows of points from a file, skinned as they are: section curves of a bone or a blade (Gan et al. 2014 start
from 17 rows x 100 points).

A text file of blocks (`mesh.point_files`), one row a block. A first and a last block of one point are the
poles; rows between poles are closed. Rows without poles are closed where every row ends on the point it began
with, else open. Closed rows are turned counter-clockwise seen along the direction from row to row, so that
the surface faces outward, and rotated to one seam where they twist.

The closed solid of a blade: the skin of its sections, with its blunt edge and both ends closed. Two chains of vertices
are joined by a strip of triangles that advances on both alike: the edges s = low and s = high of an open surface, and
at each end the two sides of the blade between the two points farthest from one another.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, lengths, unit
from bonecam.errors import FileError, SurfaceError
from bonecam.mesh.distance import barycentric, exact_closest, hausdorff
from bonecam.mesh.files.points import POINTS, read_blocks
from bonecam.mesh.healing import holes_of
from bonecam.mesh.rows import lengths_along
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.basis import (
    FEWEST,
    clamped,
    clamped_spans,
    collocation,
    insertion,
    interpolate,
    sites,
    span_functions,
)
from bonecam.surface.tmesh import OpenRowTMesh, RowTMesh
from bonecam.surface.tspline import TSpline

FEWEST_CLOSED, FEWEST_OPEN = 5, 4
"""Least number of points of a row."""
STEPS = 8, 256
"""Fewest and most grid steps in a typical distance of two parameters; coarse grids move the parameters, fine
ones make many knots."""
FINEST = 2048
"""Grid steps of all beyond the fewest."""
SAME = 1e-9
"""Knots of different rows that are no farther apart differ by rounding."""


@dataclass(frozen=True, eq=False)
class RowCurves:
    """Row i is interpolated by the cubic with knots[i] and control_points[i] that meets points[i] at
    parameters[i]."""

    closed: bool
    points: tuple[Float[ndarray, "_ 3"], ...]
    parameters: tuple[Float[ndarray, " _"], ...]
    knots: tuple[Float[ndarray, " _"], ...]
    control_points: tuple[Float[ndarray, "_ 3"], ...]

    @classmethod
    def through(cls, rows: Sequence[ndarray] | ndarray, closed: bool) -> "RowCurves":
        """Raises ValueError on rows with too few points, points that coincide or are not finite, naming row
        and point."""
        points = tuple(np.array(row, dtype=np.float64) for row in rows)
        for i, row in enumerate(points):
            _check(i, row, closed)
        parameters = shared([chord_lengths(row, closed) for row in points], closed)
        knots = tuple(s if closed else s[2:-2] for s in parameters)  # open: without the second, the last but one
        control = tuple(interpolate(k, s, row, closed) for k, s, row in zip(knots, parameters, points))
        return cls(closed, points, parameters, knots, control)

    @property
    def union(self) -> Float[ndarray, " k"]:
        """All distinct knots of all rows, increasing."""
        return distinct(np.concatenate(self.knots), SAME)

    def at(self, s: Float[ndarray, " n"]) -> Float[ndarray, "m n 3"]:
        """All curves at the same parameters."""
        return np.array([collocation(k, s, self.closed) @ c for k, c in zip(self.knots, self.control_points)])


def distinct(knots: Float[ndarray, " n"], apart: float) -> Float[ndarray, " k"]:
    """Knots in [0, 1), increasing, of those that are no farther apart, across the seam too, only one."""
    knots = np.unique(knots)
    knots = knots[np.diff(knots, prepend=-1.0) > apart]
    return knots[knots - knots.min(initial=1.0) < 1 - apart]


def _check(number: int, row: ndarray, closed: bool) -> None:
    if row.ndim != 2 or row.shape[1] != 3:
        raise ValueError(f"row {number} has the shape {row.shape}: give points (p, 3)")
    fewest = FEWEST_CLOSED if closed else FEWEST_OPEN
    if len(row) < fewest:
        raise ValueError(
            f"row {number} has {len(row)} points: {'a closed' if closed else 'an open'} row needs at least {fewest}"
        )
    if not np.isfinite(row).all():
        raise ValueError(f"row {number}, point {int(np.argmin(np.isfinite(row).all(axis=1)))} is not finite")
    # Whether each point lies on the next one, to within rounding
    coincide = np.linalg.norm(_steps(row, closed), axis=1) <= 64 * np.finfo(float).eps * np.abs(row).max()
    if coincide.any():
        k = int(np.argmax(coincide))
        raise ValueError(f"row {number}: points {k} and {(k + 1) % len(row)} coincide: remove one of them")


def _steps(row: ndarray, closed: bool) -> ndarray:
    return np.roll(row, -1, axis=0) - row if closed else np.diff(row, axis=0)


def chord_lengths(row: Float[ndarray, "p 3"], closed: bool) -> Float[ndarray, " p"]:
    """Accumulated share of the row's length: from 0, to 1 in an open row."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(_steps(row, closed), axis=1))])
    share = length / length[-1]
    return share[:-1] if closed else share


def shared(parameters: list[Float[ndarray, " _"]], closed: bool) -> tuple[Float[ndarray, " _"], ...]:
    """One mean for all rows where they have equal counts, else each its own on a grid."""
    if len({len(s) for s in parameters}) == 1:
        mean = np.mean(parameters, axis=0)
        return (mean,) * len(parameters)
    typical = float(np.median(np.concatenate([np.diff(s) for s in parameters])))
    count = 2 * int(np.ceil(max(STEPS[0] / typical, min(STEPS[1] / typical, FINEST)) / 2))
    return tuple(_on_grid(s, count, closed) for s in parameters)


def _on_grid(s: ndarray, count: int, closed: bool) -> ndarray:
    """Rounded to multiples of 1 / count where that keeps all apart."""
    rounded = np.round(s * count) / count
    apart = (np.diff(rounded) > 0).all() and not (closed and rounded[-1] >= 1)
    return rounded if apart else s


REWEIGHTED_BELOW = 1.6
"""A least-squares fit whose largest error is from one to this many tolerances is fitted again with other
weights."""

MAX_REWEIGHTINGS = 5
"""Times that one curve is fitted again with other weights at most."""

MAX_NEEDED = 6
"""So many needed knots in a row end the search for knots that can be taken out."""

SPARED = 3.0
"""Removal lowers the control points of what was inserted by less: by 1.0 to 1.6 of all rows of circles with noise of
0.0001 to 1 mm, by 2.5 of a single row."""


class Reduction:
    """Reduces curves given on the `fine` knots to subsets of the `candidates` among them; open curves keep
    their ends."""

    def __init__(self, fine: Float[ndarray, " k"], candidates: Float[ndarray, " c"], closed: bool) -> None:
        self.candidates = candidates
        self.closed = closed
        self._fine = fine
        self._sites = sites(fine, closed)
        self._weights = (
            ((np.diff(self._sites, prepend=self._sites[-1] - 1) + np.diff(self._sites, append=self._sites[0] + 1)) / 2)
            if closed
            else np.gradient(self._sites)
        )

    def least_of_all(
        self, curves: Sequence[Float[ndarray, "n ... d"]], tolerance: float, most: float = np.inf
    ) -> list[tuple[ndarray, ndarray]] | None:
        """Kept knots and control points of each curve, which differ from the given one by less than `tolerance`
        everywhere; None where they need more than `most` control points together. Of several in one (n, c, d) all keep
        the same knots, which suffice for each: what a tensor product needs.

        Curves that need many more are told by the knots inserted, before any is taken out again.
        """
        inserted: list[ndarray] = []
        size = 4 * (not self.closed) * len(curves)
        for points in curves:
            # The fewest candidates to begin with and those inserted at the peaks of the error, until it is below the
            # tolerance everywhere, or they are more than `most`.
            room = SPARED * most - size
            count = len(self.candidates)
            kept = (
                np.unique(np.linspace(0, count, FEWEST, endpoint=False).astype(np.int64))
                if self.closed
                else np.empty(0, dtype=np.int64)
            )
            while len(kept) < min(count, room + 1):
                error = self._fit(kept, points, tolerance)[1]
                if error.max() < tolerance:
                    break
                # Where a value is no smaller than its two neighbours.
                lower, upper = np.roll(error, 1), np.roll(error, -1)
                if not self.closed:
                    lower[0] = upper[-1] = -np.inf
                peaks = self._sites[np.flatnonzero(((error >= lower) & (error >= upper)) & (error >= tolerance))]
                free = np.setdiff1d(np.arange(count), kept)
                # The number of the knot that is nearest to each parameter, the short way round a closed curve
                knots = self.candidates[free]
                before, behind = (knots[-1] - 1, knots[0] + 1) if self.closed else (-np.inf, np.inf)
                around = np.concatenate([[before], knots, [behind]])
                right = np.searchsorted(around[1:-1], peaks) + 1
                nearer_left = peaks - around[right - 1] <= around[right] - peaks
                kept = np.union1d(kept, free[((right - 1 - nearer_left) % len(knots))])
            size += len(kept)
            if size > SPARED * most:
                return None
            inserted.append(kept)
        reduced = []
        size = 4 * (not self.closed) * len(curves)
        for points, kept in zip(curves, inserted):
            kept = self._remove_knots(kept, points, tolerance)
            size += len(kept)
            if size > most:
                return None
            control = self._fit(kept, points, tolerance)[0]
            reduced.append((self.candidates[kept], control.reshape(-1, *points.shape[1:])))
        return reduced

    def _fit(
        self, kept: Int[ndarray, " k"], points: Float[ndarray, "n ... d"], tolerance: float
    ) -> tuple[Float[ndarray, "c _"], Float[ndarray, " n"]]:
        """The control points on the kept candidates that fit best, and the largest error of all curves at
        each fine control point.

        Where least squares miss the tolerance narrowly, weights that grow with the error (Lawson 1961) lower
        the largest error.
        """
        matrix = insertion(self.candidates[kept], self._fine, self.closed)
        flat = points.reshape(len(points), -1)
        weights = self._weights
        best = self._solve(matrix, flat, weights)
        least = np.inf
        solution = best
        for _ in range(1 + MAX_REWEIGHTINGS):
            difference = (matrix @ solution - flat).reshape(len(points), -1, points.shape[-1])
            now = np.linalg.norm(difference, axis=2).max(axis=1)
            if now.max() < least:
                best = solution
                error = now
                least = now.max()
            if not tolerance <= least < REWEIGHTED_BELOW * tolerance:
                break
            weights = weights * (now / now.max() + 1e-3)
            solution = self._solve(matrix, flat, weights)
        return best, error

    def _solve(self, matrix: sp.csr_array, points: ndarray, weights: ndarray) -> ndarray:
        """Control points by weighted least squares; the ends of open curves stay."""
        if self.closed:
            return _least_squares(matrix, points, weights)
        inner = points - matrix[:, [0, -1]] @ points[[0, -1]]
        return np.vstack([points[:1], _least_squares(matrix[:, 1:-1], inner, weights), points[-1:]])

    def _remove_knots(self, kept: ndarray, points: ndarray, tolerance: float) -> Int[ndarray, " k"]:
        """The kept candidates without those that can be spared, tried in the order of the error without them,
        until MAX_NEEDED in a row cannot be spared."""
        if len(kept) <= (FEWEST if self.closed else 0):
            return kept
        lacks = [self._fit(np.delete(kept, k), points, 0.0)[1].max() for k in range(len(kept))]
        needed = 0
        for knot in kept[np.argsort(lacks, kind="stable")]:
            tried = kept[kept != knot]
            if self._fit(tried, points, tolerance)[1].max() < tolerance:
                kept = tried
                needed = 0
            else:
                needed += 1
            if needed == MAX_NEEDED or len(kept) <= (FEWEST if self.closed else 0):
                break
        return kept


def _least_squares(matrix: sp.csr_array, points: ndarray, weights: ndarray) -> ndarray:
    """Weighted least squares by normal equations; one step of iterative refinement restores the digits they
    lose."""
    weighted = (matrix * (weights / weights.sum())[:, None]).T
    normal = (weighted @ matrix).toarray()
    factor = la.cho_factor(normal)
    solution = la.cho_solve(factor, weighted @ points)
    return solution + la.cho_solve(factor, weighted @ (points - matrix @ solution))


SPARSE = 120
"""Fewer fine knots than this are halved: the bound gets tighter."""

AROUND = 100
"""Parameters at which the distance of neighbouring rows is measured."""

LOOSER = 1.5
"""Steps in which the tolerance reached is looked for."""

LARGEST = 20_000_000
"""Control points of all control curves before their knots are reduced: some 2 GB."""

NOTHING = 1e-12
"""Share of the size: no tolerance below this."""


@dataclass(frozen=True, eq=False)
class ControlCurves:
    """The curves points[j] on the knots `fine` that blend, over t_knots, to the sections; they have no knots
    but the candidates."""

    closed: bool
    t_knots: Float[ndarray, " k"]
    fine: Float[ndarray, " f"]
    candidates: Float[ndarray, " c"]
    points: Float[ndarray, "r n 3"]

    def reduce(self, tolerance: float, most: float = np.inf) -> TSpline | None:
        """The surface with the fewest knots in every row that keep it within `tolerance` (mm); a pole is
        one point. None where it needs more than `most` control points.
        """
        whole = [q for q in self.points if not _point(q)]
        poles = len(self.points) - len(whole)
        reduction = Reduction(self.fine, self.candidates, self.closed)
        reduced = reduction.least_of_all(whole, tolerance, most - poles)
        if reduced is None:
            return None
        following = iter(reduced)
        rows = [(np.zeros(1), q[:1]) if _point(q) else next(following) for q in self.points]
        knots, control = zip(*rows)
        tmesh = (
            RowTMesh.from_rows(self.t_knots, knots)
            if self.closed
            else OpenRowTMesh.from_rows(self.t_knots, [clamped(inner) for inner in knots])
        )
        return TSpline(tmesh, np.vstack(control), np.ones(tmesh.size))

    @property
    def least(self) -> int:
        """No reduction leaves fewer control points."""
        return sum(1 if _point(q) else 4 for q in self.points)


def _point(curve: ndarray) -> bool:
    return bool(np.abs(curve - curve[0]).max() <= 1e-9 * np.abs(curve).max())


def skin(
    rows: Sequence[ndarray] | ndarray,
    tolerance: float,
    *,
    closed: bool = True,
    poles: Float[ndarray, "2 3"] | None = None,
    max_control_points: int | None = None,
) -> TSpline:
    """The T-spline that passes every row's interpolating curve within `tolerance` (mm), everywhere between
    its points too.

    `rows`: two or more, each (p, 3) with its own p, closed ones starting on one seam (with poles: from the
    lower pole up, counter-clockwise seen from the upper one); poles, of closed rows only, are met exactly.
    ValueError on rows that are no rows; SurfaceError, with `reached` (mm) in its evidence, where
    `max_control_points` or rounding do not allow the tolerance.
    """
    if not tolerance > 0:
        raise ValueError(f"tolerance {tolerance}: give a length above 0")

    if len(rows) < 2:
        raise ValueError(f"{len(rows)} rows: give two or more rows of points")
    if poles is not None and not (closed and np.shape(poles) == (2, 3) and np.isfinite(poles).all()):
        raise ValueError("poles are the two finite end points (2, 3) of closed rows")
    curves = RowCurves.through(rows, closed)

    control = control_curves(curves, poles)
    size = float(np.linalg.norm(np.ptp(np.vstack(curves.points), axis=0)))
    if tolerance < NOTHING * size:
        raise SurfaceError(
            f"{tolerance} mm is below rounding: ask for {NOTHING * size:.1e} mm or more", reached=NOTHING * size
        )
    if max_control_points is not None and control.least > max_control_points:
        raise SurfaceError(
            f"the rows need {control.least} control points at least: "
            f"raise surface.max_control_points ({max_control_points})",
            needed=control.least,
        )
    most = np.inf if max_control_points is None else float(max_control_points)
    surface = control.reduce(tolerance, most)
    if surface is None:
        # The error that says what the control points allowed do reach
        reached = LOOSER * tolerance
        while control.reduce(reached, most) is None:
            reached *= LOOSER
        raise (
            SurfaceError(
                f"{tolerance:g} mm needs more than {most:g} control points, which reach {reached:.3g} mm: "
                "smooth the rows, or raise surface.tolerance or surface.max_control_points",
                reached=reached,
            )
        )
    return surface


def row_parameters(curves: RowCurves, poles: Float[ndarray, "2 3"] | None = None) -> Float[ndarray, " k"]:
    """t of the rows (and of the poles before and behind) in [0, 1]: the accumulated mean distance between
    neighbours."""
    sections = curves.at(np.arange(AROUND) / (AROUND if curves.closed else AROUND - 1))
    if poles is not None:
        sections = np.concatenate([_pole(poles[0], AROUND), sections, _pole(poles[1], AROUND)])
    steps = np.linalg.norm(np.diff(sections, axis=0), axis=2).mean(axis=1)
    if (steps <= 0).any():
        number = int(np.argmin(steps)) - (poles is not None)
        raise ValueError(f"rows {number} and {number + 1} coincide: remove one of them")
    t = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    t[-1] = 1.0
    return t


def _pole(pole: ndarray, count: int) -> ndarray:
    return np.broadcast_to(pole, (1, count, 3))


def control_curves(curves: RowCurves, poles: Float[ndarray, "2 3"] | None = None) -> ControlCurves:
    """The control curves that meet all sections."""
    closed = curves.closed
    t = row_parameters(curves, poles)
    candidates = (
        curves.union
        if poles is None
        else distinct(np.concatenate([curves.union, np.mod(curves.union + 0.5, 1.0)]), 1e-3 / len(curves.union))
    )
    fine = _halve(candidates, closed) if len(candidates) < SPARSE else candidates
    if len(fine) * len(t) > LARGEST:
        what = f"{len(curves.points)} rows have {len(curves.union)} knots together"
        raise ValueError(f"{what}: give all rows equal counts of points, or fewer points")
    at = sites(fine, closed)
    sections = curves.at(at)
    if poles is not None:
        ends = [_pole(pole, len(at)) for pole in poles]
        opposite = np.concatenate([ends[0], curves.at(np.mod(at + 0.5, 1.0)), ends[1]])
        sections = np.concatenate([ends[0], sections, ends[1]])
        knots = clamped(t[1:-1])
        # Control curves with the even part flat in the poles, the odd part with natural ends
        control = _solve(t, (sections + opposite) / 2, 1) + _solve(t, (sections - opposite) / 2, 2)
    elif len(t) < 4:
        knots = clamped(t[1:-1])
        control = _solve(t, sections, 2)
    else:
        knots = clamped(np.array([t[j : j + 3].mean() for j in range(1, len(t) - 3)]))
        control = np.linalg.solve(_values(knots, t), sections.reshape(len(t), -1)).reshape(sections.shape)
    return ControlCurves(
        closed, knots, fine, candidates, np.array([interpolate(fine, at, row, closed) for row in control])
    )


def _halve(knots: ndarray, closed: bool) -> ndarray:
    whole = np.append(knots, knots[0] + 1) if closed else np.concatenate([[0.0], knots, [1.0]])
    return np.unique(np.concatenate([knots, np.mod((whole[:-1] + whole[1:]) / 2, 1.0)]))


def _solve(t: ndarray, sections: Float[ndarray, "k n 3"], order: int) -> Float[ndarray, "k+2 n 3"]:
    """k + 2 control curves whose clamped cubic meets the k sections at t, its `order`-th derivative zero at
    both ends."""
    zero = np.zeros_like(sections[:1])
    right = np.concatenate([sections[:1], zero, sections[1:-1], zero, sections[-1:]])
    # The banded system: values at all t, and the `order`-th derivative at both ends (second and last but one
    # equation)
    x = np.concatenate([t[:1], t, t[-1:]])
    matrix = _values(clamped(t[1:-1]), x)
    matrix[[1, -2]] = _values(clamped(t[1:-1]), x, order)[[1, -2]]
    control: ndarray = la.solve(matrix, right.reshape(len(right), -1)).reshape(right.shape)
    return control


def _values(knots: ndarray, x: ndarray, order: int = 0) -> ndarray:
    """The clamped functions, or their `order`-th derivatives, at x: (n, r)."""
    span, window = clamped_spans(knots, x)
    matrix = np.zeros((len(x), len(knots) - 4))
    columns = span[:, None] + np.arange(-3, 1)
    matrix[np.arange(len(x))[:, None], columns] = span_functions(window, x, order)[order]
    return matrix


FEWEST_POINTS, MOST = 10, 80
"""Rows, and points a row, of the first and of the last trial."""
SPAN = 0.02
"""A corner of the edge is seen over this share of its length before and behind it."""
APART = 0.05
"""Corners are this share of the edge's length apart at least."""
CHORD_SHARE = 0.1
"""Chord tolerance of the tessellation that deviations are measured to, in shares of the tolerance."""


def patch_surface(mesh: TriangleMesh, tolerance: float) -> TSpline:
    """The open T-spline within `tolerance` (mm) of an open mesh (mm) and all its vertices, facing as its triangles do;
    the four sharpest corners of the mesh's edge are its corners.

    SurfaceError where the mesh has no edge or more than one, no four corners, or where MOST rows are not enough.
    """
    # The vertices in a rectangle, and the rectangle's size, mm.
    import igl

    loops = igl.boundary_loop_all(mesh.faces)
    if len(loops) != 1:
        what = f"has {len(loops)} edges" if len(loops) else "is closed"
        raise SurfaceError(f"a patch of one piece has one edge, this mesh {what}: cut it open", edges=len(loops))
    edge = np.asarray(loops[0], dtype=np.int64)
    sides = _sides(mesh.vertices, edge)
    ways = [np.r_[0.0, np.cumsum(lengths(np.diff(mesh.vertices[side], axis=0)))] for side in sides]
    size = np.array([(ways[k][-1] + ways[k + 2][-1]) / 2 for k in (0, 1)])
    corners = np.array([[0, 0], [size[0], 0], size, [0, size[1]], [0, 0]])
    border_points = []
    for k, way in enumerate(ways):
        share = way[:-1, None] / way[-1]
        border_points.append((1 - share) * corners[k] + share * corners[k + 1])
    border = np.concatenate([side[:-1] for side in sides])
    flat = igl.harmonic(mesh.vertices, mesh.faces, border, np.vstack(border_points), 1)
    count = FEWEST_POINTS
    while True:
        # Rows of points on the mesh at equal distances in the rectangle, `count` both ways
        u, v = (np.linspace(0.0, side, count) for side in size)
        asked = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        raised = TriangleMesh(np.column_stack([flat, np.zeros(len(flat))]), mesh.faces)
        nearest, face = exact_closest(raised, np.column_stack([asked, np.zeros(len(asked))]))
        shares = barycentric(raised.vertices[mesh.faces[face]], nearest)
        points = np.einsum("nk,nkd->nd", shares, mesh.vertices[mesh.faces[face]])
        rows = list(points.reshape(count, count, 3))

        surface = skin(rows, tolerance / 2, closed=False)
        skinned = surface.tessellate(CHORD_SHARE * tolerance)
        deviation = max(hausdorff(skinned, mesh))
        if deviation <= tolerance:
            return surface
        count *= 2
        if count > MOST:
            raise SurfaceError(
                f"the surface through the mesh misses it by {deviation:.3g} mm: smooth the mesh, "
                f"or raise surface.tolerance ({tolerance:g} mm)",
                deviation_mm=deviation,
            )


def _sides(vertices: Float[ndarray, "v 3"], edge: Int[ndarray, " e"]) -> list[Int[ndarray, " _"]]:
    """The runs of the edge between its four sharpest corners, both ends included."""
    points = vertices[edge]
    along = np.r_[0.0, np.cumsum(lengths(np.diff(points, axis=0, append=points[:1])))]
    whole = along[-1]
    along = along[:-1]

    def at(place: Float[ndarray, " e"]) -> Float[ndarray, "e 3"]:
        wrapped = np.mod(place, whole)
        return np.column_stack(
            [np.interp(wrapped, np.r_[along, whole], np.r_[points[:, k], points[0, k]]) for k in range(3)]
        )

    before = points - at(along - SPAN * whole)
    behind = at(along + SPAN * whole) - points
    turn = angles_between(unit(before), unit(behind))
    corners: list[int] = []
    for place in np.argsort(-turn):
        apart = [abs((along[place] - along[corner] + whole / 2) % whole - whole / 2) for corner in corners]
        if len(corners) < 4 and min(apart, default=whole) >= APART * whole:
            corners.append(int(place))
    if len(corners) < 4:
        raise SurfaceError("the edge of the mesh has no four corners: give a patch with four sides")
    corners.sort()
    rolled = np.roll(edge, -corners[0])
    bounds = [*(corner - corners[0] for corner in corners), len(edge)]
    closed = np.r_[rolled, rolled[:1]]
    return [closed[low : high + 1] for low, high in pairwise(bounds)]


TWISTED = 1.2
"""A row is rotated where that brings it nearer to the row before by this factor."""

COMPARED = 64
"""Points of two rows that are compared."""

TRIED = 512
"""Points that a row is tried to begin with at most."""


@dataclass(frozen=True, eq=False)
class PointRows:
    """Rows (p, 3), each with its own number of points, from the lower pole up where there are `poles` (2,
    3)."""

    rows: tuple[Float[ndarray, "_ 3"], ...]
    poles: Float[ndarray, "2 3"] | None
    closed: bool

    def scaled(self, factor: float) -> "PointRows":
        """The rows with all coordinates multiplied by a factor."""
        return PointRows(
            tuple(row * factor for row in self.rows), None if self.poles is None else self.poles * factor, self.closed
        )

    def skin(self, tolerance: float, max_control_points: int | None = None) -> TSpline:
        """The T-spline through the rows: see `surface.skin`."""
        return skin(self.rows, tolerance, closed=self.closed, poles=self.poles, max_control_points=max_control_points)


def holds_rows(path: str | Path) -> bool:
    """Whether a file is a text file of two or more blocks of points."""
    return Path(path).suffix.lower() in POINTS and len(read_blocks(path)) > 1


def read_rows(path: str | Path) -> PointRows:
    """The rows of points in a file, in the file's unit. FileError names the row that is wrong."""
    return rows_of(list(read_blocks(path)), Path(path))


def rows_of(blocks: list[Float[ndarray, "_ 3"]], path: Path) -> PointRows:
    """The rows of the blocks of points that came from a file. FileError names the row that is wrong."""
    # The first and the last block where both are one point
    single = [len(block) == 1 for block in (blocks[0], blocks[-1])]
    if any(single) and not all(single):
        raise FileError(
            f"{path}: has one pole only: give the other as the {'last' if single[0] else 'first'} block", file=str(path)
        )
    poles = np.vstack([blocks[0], blocks[-1]]) if all(single) and len(blocks) > 1 else None
    rows = blocks if poles is None else blocks[1:-1]
    if len(rows) < 2:
        held = f"holds one block of {len(blocks[0])} points"
        if poles is not None:
            few = "one row only" if rows else "no row"
            held = f"has {few} between its poles, the first and the last block of one point"
        raise FileError(f"{path}: {held}: give two rows or more, an empty line between them", file=str(path))
    least = SAME * float(np.linalg.norm(np.ptp(np.vstack(blocks), axis=0)))
    touching = [len(row) > 3 and np.linalg.norm(row[0] - row[-1]) <= least for row in rows]
    closed = poles is not None or all(touching)
    rows = [row[:-1] if closed and touches else row for row, touches in zip(rows, touching)]
    fewest = FEWEST_CLOSED if closed else FEWEST_OPEN
    for number, row in enumerate(rows):
        steps = np.linalg.norm(np.roll(row, -1, axis=0) - row, axis=1)[: None if closed else -1]
        if len(row) < fewest:
            remedy = f"give {fewest} or more"
            raise FileError(f"{path}: row {number} has {len(row)} points: {remedy}", file=str(path), row=number)
        if steps.min() <= least:
            place = int(np.argmin(steps))
            raise FileError(
                f"{path}: row {number}: points {place} and the next coincide: remove one", file=str(path), row=number
            )
    return PointRows(tuple(_oriented(rows, poles) if closed else rows), poles, closed)


def _oriented(rows: list[ndarray], poles: Float[ndarray, "2 3"] | None) -> list[ndarray]:
    """Closed rows turned one way round and begun on one seam."""
    middles = np.array([row.mean(axis=0) for row in rows])
    ends = middles[[0, -1]] if poles is None else poles
    way = np.gradient(np.vstack([ends[:1], middles, ends[1:]]), axis=0)[1:-1]
    areas = np.array(
        [
            np.cross(row - middle, np.roll(row, -1, axis=0) - middle).sum(axis=0) / 2
            for row, middle in zip(rows, middles)
        ]
    )
    if np.einsum("ri,ri->", areas, way) < 0:
        rows = [np.roll(row[::-1], 1, axis=0) for row in rows]
    oriented = rows[:1]
    for row in rows[1:]:
        # The point of a row to begin with, so that it runs beside the row before; 0 where that does not bring it
        # clearly nearer
        before = oriented[-1]
        target = _even(before) - before.mean(axis=0)
        moved = row - row.mean(axis=0)
        starts = np.linspace(0, len(row), min(len(row), TRIED), endpoint=False).astype(np.int64)
        away = np.array([np.linalg.norm(_even(np.roll(moved, -k, axis=0)) - target) for k in starts])
        best = int(np.argmin(away))
        oriented.append(np.roll(row, -(int(starts[best]) if away[0] > TWISTED * away[best] else 0), axis=0))
    return oriented


def _even(row: ndarray) -> ndarray:
    """Points of a closed row at equal arc lengths from its first."""
    chain = np.vstack([row, row[:1]])
    along = lengths_along(chain)
    wanted = along[-1] * np.arange(COMPARED) / COMPARED
    return np.column_stack([np.interp(wanted, along, chain[:, axis]) for axis in range(3)])


BLUNT = 0.02
"""Sections whose ends lie farther apart than this share of their length are one side of a blade."""
SECTIONS = 9
"""So many sections of a surface are looked at,"""
PLACES = 101
"""and so many places on each."""


def has_blunt_edge(surface: TSpline) -> bool:
    """Whether a surface that is open in s bounds a blade up to a blunt edge: it is no one side of a blade."""
    if surface.closed_in_s:
        return False
    (left, right), (low, high) = surface.domain
    s, t = np.meshgrid(np.linspace(left, right, PLACES), np.linspace(low, high, SECTIONS))
    rows = surface.positions(s.ravel(), t.ravel()).reshape(SECTIONS, PLACES, 3)
    return all(nearly_closed(row) for row in rows)


def nearly_closed(row: Float[ndarray, "p 3"]) -> bool:
    """Whether the ends of a section are no farther apart than a blunt edge is wide."""
    length = float(np.linalg.norm(np.diff(row, axis=0), axis=1).sum())
    return float(np.linalg.norm(row[0] - row[-1])) <= BLUNT * length


def blade_solid(surface: TSpline, chord_tolerance: float) -> TriangleMesh:
    """The closed outward mesh of a surface without poles, within `chord_tolerance` mm of it where that is.

    SurfaceError where no closed outward mesh comes of it.
    """
    tessellation = surface.tessellate_with_parameters(chord_tolerance)
    s, t = tessellation.parameters.T
    points = tessellation.mesh.vertices
    (left, right), (low, high) = surface.domain
    faces = [tessellation.mesh.faces]
    if not surface.closed_in_s:
        first, last = (_sorted(s == side, t) for side in (left, right))
        faces.append(_strip(first, t[first], last, t[last]))
    for end in (low, high):
        loop = _sorted(t == end, s)
        # Triangles that close a loop and run against it.
        run = loop if end == low else loop[::-1]
        away = np.linalg.norm(points[run][:, None] - points[run], axis=2)
        near, far = sorted(int(i) for i in np.unravel_index(np.argmax(away), away.shape))
        one = run[near : far + 1][::-1]
        other = np.r_[run[far:], run[: near + 1]]
        ways = [lengths_along(points[side]) for side in (one, other)]
        faces.append(_strip(one, ways[0] / ways[0][-1], other, ways[1] / ways[1][-1]))
    solid = TriangleMesh(points, np.vstack(faces).astype(np.int32))
    if holes_of(solid) or not solid.volume > 0:
        raise SurfaceError(
            f"the blade encloses {solid.volume:.3g} mm^3 and keeps {len(holes_of(solid))} holes: give sections that "
            "run once round it, from the hub outward"
        )
    return solid


def _sorted(chosen: ndarray, along: Float[ndarray, " n"]) -> Int[ndarray, " k"]:
    """The chosen vertices in the order of a parameter."""
    index = np.flatnonzero(chosen)
    return index[np.argsort(along[index])]


def _strip(
    one: Int[ndarray, " a"], at_one: Float[ndarray, " a"], other: Int[ndarray, " b"], at_other: Float[ndarray, " b"]
) -> Int[ndarray, "f 3"]:
    """Triangles between two chains of vertices at growing places, forward along the first."""
    faces = []
    i = j = 0
    while i + 1 < len(one) or j + 1 < len(other):
        if j + 1 == len(other) or (i + 1 < len(one) and at_one[i + 1] <= at_other[j + 1]):
            faces.append((one[i], one[i + 1], other[j]))
            i += 1
        else:
            faces.append((one[i], other[j + 1], other[j]))
            j += 1
    triangles = np.array(faces)
    apart = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return triangles[apart]
