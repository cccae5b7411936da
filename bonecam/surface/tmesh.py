"""T-meshes: which control points there are and which knots each sees.

The general T-mesh in index space: T-, I- and L-junctions, domains that are not rectangles, open and closed
directions.

Index lines are numbered in either direction and carry knots that never decrease; a line may repeat a knot (a
clamped border is two lines one of which only borders empty intervals). On this grid a T-mesh is: which
crossings are vertices (each a control point), which pieces between neighbouring crossings are edges, and
which cells belong to the domain. A closed direction has as many cells as lines, the last of them back to line
0 at knot + period.

Faces are the rectangles that edges bound. Local knot vectors come from rays (surface.rays). Meshes with
extraordinary points have no such grid: they come as Bezier elements (surface.iga).

The faces of a T-mesh in index space: cells joined where no edge parts them.

Local knot vectors of a T-mesh by ray shooting in index space (Sederberg et al. 2003, Rule 1).

From a vertex a ray runs along its index line and takes the knot of each vertex or perpendicular edge that it
hits, two to either side. Where the ray leaves the domain the last knot repeats; in a closed direction the ray
goes round. All comparisons are between line numbers, so knots that a file holds twice with different last
digits are one.

Cutting faces of a general T-mesh: new lines, edges and vertices on its index grid.

A cut runs through its face to the edges on either side and puts a vertex there; empty intervals beyond (the
lines of a clamped border) are cut as well, so that a border stays clamped. A row that passes all round a
closed direction is given four knots at least.

T-junctions of a general T-mesh and where their extensions meet (Scott, Li, Sederberg & Hughes 2012,
Definition 1).

A T-junction is a vertex with three edges inside the domain. Its extension runs against the missing edge to
the first knot (edge extension) and through the missing edge to the second (face extension). A T-mesh in which
no extension along s meets one along t is analysis-suitable: its blending functions are linearly independent
and sum to one for some weights.

A T-mesh that is known by its Bezier elements only: what an .iga file gives, extraordinary points included.

The elements share no chart, so each has a parameter square of its own: element e is [2 e, 2 e + 1] x [0, 1].

Row-structured T-meshes with open rows: S(s, t) = sum_j N_j(t) Q_j(s), both directions clamped, every row
with its own s-knots.

What skinning makes of open sections (Yang & Zheng 2012). The sum over a row is one, so the weights may be
left at one.

The T-mesh in index and knot space: which control points there are and which knots each sees.

Row-structured T-meshes (what skinning makes, Yang & Zheng 2012): S(s, t) = sum_j N_j(t) Q_j(s), one clamped
t-knot vector for all rows and a periodic s-knot vector for every row. A row with one control point is a pole:
its s-function is the constant 1.

The interface of a T-spline surface, without state, for queries, tessellation and refinement.

`surface.tspline.TSpline` is the one class that implements it. The interface lies below the rooms that
compute with a surface and the class above them, so that its methods may call them.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int64
from numpy import ndarray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from bonecam.arrays import frozen
from bonecam.errors import SurfaceError
from bonecam.surface.basis import (
    Elements,
    bernstein_coefficients,
    distinct,
    extract_local,
    extract_rows,
    fault,
    span_functions,
)


def local_lines(
    line: Int64[ndarray, " n"],
    row: Int64[ndarray, " n"],
    hits: Bool[ndarray, "a b"],
    passes: Bool[ndarray, "p b"],
    closed: bool,
) -> Int64[ndarray, "n 5"]:
    """The five lines that the ray through each vertex at (line, row) meets; -1 and a: once round a closed
    direction, and so on.

    hits[i, j]: a vertex or a perpendicular edge stops the ray of row j on line i. passes[i, j]: the ray of
    row j may run between lines i and i + 1. Raises SurfaceError for a closed row with fewer than four hits.
    """
    count = hits.shape[0]
    result = np.empty((len(line), 5), dtype=np.int64)
    for j in np.unique(row):
        here = np.flatnonzero(row == j)
        stops = np.flatnonzero(hits[:, j])
        gaps = np.concatenate([[0], np.cumsum(~passes[:, j])])
        if closed and passes[:, j].all():
            if len(stops) < 4:
                raise SurfaceError(
                    f"row {j} of a closed direction has {len(stops)} distinct knots: give it four or more", row=int(j)
                )
            place = np.searchsorted(stops, line[here])[:, None] + np.arange(-2, 3)
            result[here] = stops[place % len(stops)] + count * (place // len(stops))
        elif closed:
            unrolled = np.concatenate([stops - count, stops, stops + count])
            walls = np.concatenate([gaps[:-1], gaps[-1] + gaps[:-1], 2 * gaps[-1] + gaps])
            result[here] = _open(line[here], unrolled, walls, count)
        else:
            result[here] = _open(line[here], stops, gaps, 0)
    return result


def _open(line: ndarray, stops: ndarray, walls: ndarray, shift: int) -> ndarray:
    """Two stops to either side of each line, the last one before a wall repeated. walls[i + shift]: gaps
    before line i."""
    indices = np.empty((len(line), 5), dtype=np.int64)
    indices[:, 2] = line
    place = np.searchsorted(stops, line)
    for step in (-1, 1):
        last = line
        for k in (1, 2):
            index = np.clip(place + step * k, 0, len(stops) - 1)
            reached = (place + step * k == index) & (walls[stops[index] + shift] == walls[line + shift])
            last = np.where(reached, stops[index], last)
            indices[:, 2 + step * k] = last
    return indices


def knots_of_lines(lines: Int64[ndarray, "n k"], knots: Float[ndarray, " a"], period: float) -> Float[ndarray, "n k"]:
    """Knot values of line numbers, those beyond the ends of a closed direction moved by whole periods."""
    return knots[lines % len(knots)] + period * (lines // len(knots))


def face_rectangles(widths: ndarray, heights: ndarray, inside: ndarray, along_s: ndarray, along_t: ndarray) -> ndarray:
    """Cells joined where no edge parts them, as boxes of line numbers; what lies across a seam is parted
    there.

    Only the part of a face that has an area must be a rectangle: at a clamped corner that turns inwards empty
    cells are missing.
    """
    p, q = inside.shape
    cell = np.arange(p * q).reshape(p, q)
    joined_s = inside[:-1] & inside[1:] & ~along_t[1:p, :q]
    joined_t = inside[:, :-1] & inside[:, 1:] & ~along_s[:p, 1:q]
    pairs = [(cell[:-1][joined_s], cell[1:][joined_s]), (cell[:, :-1][joined_t], cell[:, 1:][joined_t])]
    a, b = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    label = connected_components(sp.coo_array((np.ones(len(a)), (a, b)), shape=(p * q, p * q)), directed=False)[
        1
    ].reshape(p, q)
    counted = inside & (widths > 0)[:, None] & (heights > 0)
    i, j = np.nonzero(counted)
    kinds, group = np.unique(label[counted], return_inverse=True)
    low = np.full((2, len(kinds)), p + q)
    high = np.full((2, len(kinds)), -1)
    for k, index in enumerate((i, j)):
        np.minimum.at(low[k], group, index)
        np.maximum.at(high[k], group, index + 1)
    full = np.array(
        [np.count_nonzero(widths[s0:s1]) * np.count_nonzero(heights[t0:t1]) for s0, t0, s1, t1 in zip(*low, *high)]
    )
    wrong = np.flatnonzero(full != np.bincount(group, minlength=len(kinds)))
    if len(wrong):
        place = low[:, wrong[0]]
        raise SurfaceError(
            f"the face round cell ({place[0]}, {place[1]}) is not a rectangle of index lines", cell=place
        )
    return np.column_stack([low[0], high[0], low[1], high[1]])


ROUNDING = 1e-12
"""Share of the knots' size: nearer knots must be equal."""

LARGEST = 1e18
"""Knots and the inverse of their range must be smaller, lest derivatives overflow."""


@dataclass(frozen=True, eq=False)
class TMesh:
    """Lines (a,) and (b,), vertices (n, 2) as line numbers, edges along s and along t, cells of the domain,
    periods (0: open).

    along_s[i, j] is the edge on t-line j between s-lines i and i + 1; along_t[i, j] the one on s-line i
    between t-lines j and j + 1; inside[i, j] the cell between them. Raises SurfaceError naming the line,
    vertex or face that is wrong.
    """

    s_lines: Float[ndarray, " a"]
    t_lines: Float[ndarray, " b"]
    vertices: Int64[ndarray, "n 2"]
    along_s: Bool[ndarray, "_ b"]
    along_t: Bool[ndarray, "a _"]
    inside: Bool[ndarray, "_ _"]
    period: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        kinds = (np.float64, np.float64, np.int64, np.bool_, np.bool_, np.bool_)
        for name, kind in zip(("s_lines", "t_lines", "vertices", "along_s", "along_t", "inside"), kinds):
            object.__setattr__(self, name, frozen(getattr(self, name), kind))
        for letter, lines, period in (("s", self.s_lines, self.period[0]), ("t", self.t_lines, self.period[1])):
            _check_knots(letter, lines, period)
        a, b = len(self.s_lines), len(self.t_lines)
        cells = (a if self.period[0] else a - 1, b if self.period[1] else b - 1)
        for name, shape in (("along_s", (cells[0], b)), ("along_t", (a, cells[1])), ("inside", cells)):
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} has the shape {getattr(self, name).shape}: {a} x {b} lines need {shape}")
        v = self.vertices
        if len(v) == 0 or v.min() < 0 or (v >= [a, b]).any() or len(np.unique(v @ [b, 1])) != len(v):
            raise SurfaceError("every vertex needs a crossing of its own among the index lines")
        if not len(self.faces):
            raise SurfaceError("the T-mesh has no face")
        assert len(self.knot_lines[0]) == len(v)

    @property
    def size(self) -> int:
        """Number of control points."""
        return len(self.vertices)

    @property
    def poles(self) -> tuple[bool, bool]:
        """Whether an end of t is one control point: never here; a pole is a row whose control points
        coincide."""
        return False, False

    @cached_property
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[s_low, s_high], [t_low, t_high]] round all faces."""
        return self.elements.domain

    @cached_property
    def crossings(self) -> Int64[ndarray, "a b"]:
        """The vertex at each crossing of lines, -1 where there is none."""
        grid = np.full((len(self.s_lines), len(self.t_lines)), -1)
        grid[self.vertices[:, 0], self.vertices[:, 1]] = np.arange(self.size)
        return grid

    @cached_property
    def knot_lines(self) -> tuple[Int64[ndarray, "n 5"], Int64[ndarray, "n 5"]]:
        """The five s-lines and the five t-lines each vertex sees; numbers beyond the ends count on round a
        closed direction."""
        i, j = self.vertices.T
        (s_hits, s_passes), (t_hits, t_passes) = sight(
            self.crossings >= 0, (self.along_s, self.along_t), self.inside, self.period
        )
        return (
            local_lines(i, j, s_hits, s_passes, bool(self.period[0])),
            local_lines(j, i, t_hits, t_passes, bool(self.period[1])),
        )

    @cached_property
    def local_knots(self) -> tuple[Float[ndarray, "n 5"], Float[ndarray, "n 5"]]:
        """The local knot vectors in s and in t of every vertex."""
        s, t = self.knot_lines
        return knots_of_lines(s, self.s_lines, self.period[0]), knots_of_lines(t, self.t_lines, self.period[1])

    @cached_property
    def faces(self) -> Int64[ndarray, "f 4"]:
        """First and last s-line, first and last t-line of every face with an area; one across a seam counts
        as two that end there.

        Raises SurfaceError for a face that is not a rectangle.
        """
        return face_rectangles(*self.intervals, self.inside, self.along_s, self.along_t)

    @property
    def intervals(self) -> tuple[Float[ndarray, " p"], Float[ndarray, " q"]]:
        """Knot intervals between neighbouring lines, in a closed direction the one across the seam last."""
        lines = ((self.s_lines, self.period[0]), (self.t_lines, self.period[1]))
        s, t = (np.diff(knots, append=[knots[0] + length] if length else []) for knots, length in lines)
        return s, t

    @cached_property
    def face_boxes(self) -> Float[ndarray, "f 4"]:
        """(s_low, s_high, t_low, t_high) of the faces."""
        f = self.faces
        s = knots_of_lines(f[:, :2], self.s_lines, self.period[0])
        t = knots_of_lines(f[:, 2:], self.t_lines, self.period[1])
        return np.column_stack([s, t])

    @cached_property
    def elements(self) -> Elements:
        """The Bezier elements. Raises SurfaceError where all functions vanish (a border that is not
        clamped)."""
        elements = extract_local(self.face_boxes, *self.local_knots, self.period)
        sums = np.add.reduceat(elements.coefficients, elements.starts[:-1], axis=0)
        if not sums.min() > 0:
            e, c = np.unravel_index(np.argmin(sums), sums.shape)
            s = elements.boxes[e, c % 4 // 2]
            t = elements.boxes[e, 2 + c // 4 // 2]
            message = (
                f"all functions vanish at s = {s:.6g}, t = {t:.6g}: a clamped border needs its end "
                "knot on two lines of control points"
            )
            raise SurfaceError(message, place=(float(s), float(t)))
        return elements


def _check_knots(letter: str, lines: ndarray, period: float) -> None:
    if len(lines) < 2 or not np.isfinite(lines).all() or (np.diff(lines) < 0).any():
        k = int(np.argmax(~(np.diff(lines) >= 0))) + 1 if len(lines) > 1 else 0
        raise SurfaceError(
            f"the knot of {letter}-line {k} is less than the one before: knots must not decrease", line=k
        )
    if not (max(np.ptp(lines), period) > 1 / LARGEST and max(np.abs(lines).max(), period) < LARGEST):
        raise SurfaceError(
            f"the knots in {letter} are all equal, or their range is not between {1 / LARGEST:g} and {LARGEST:g}"
        )
    close = (np.diff(lines) > 0) & (np.diff(lines) < ROUNDING * max(np.ptp(lines), np.abs(lines).max()))
    if close.any():
        k = int(np.argmax(close)) + 1
        raise SurfaceError(
            f"the knots of {letter}-lines {k - 1} and {k} differ by rounding only: make them equal", line=k
        )
    if period < 0 or (period and not period > np.ptp(lines)):
        raise SurfaceError(f"the period of {letter} must be longer than its knots' range {np.ptp(lines)}, not {period}")


def sight(
    vertex: ndarray, edges: Sequence[ndarray], inside: ndarray, period: tuple[float, float]
) -> list[tuple[ndarray, ndarray]]:
    """For rays along s and along t: where something stops them (line, row), and where they may pass (piece,
    row)."""
    lines_of_sight = []
    for along, across, cells, stops, closed in (
        (edges[0], edges[1], inside, vertex, bool(period[1])),
        (edges[1].T, edges[0].T, inside.T, vertex.T, bool(period[0])),
    ):
        lines_of_sight.append((stops | _crossed(across, closed), along | beside(cells, closed)))
    return lines_of_sight


def _crossed(edges: ndarray, closed: bool) -> ndarray:
    """Where an edge runs on through a crossing: edges (a, cells) -> (a, b)."""
    if closed:
        return edges & np.roll(edges, 1, axis=1)
    through = np.zeros((edges.shape[0], edges.shape[1] + 1), dtype=bool)
    through[:, 1:-1] = edges[:, :-1] & edges[:, 1:]
    return through


def beside(inside: ndarray, closed: bool) -> ndarray:
    """Between which crossings of a row there is domain on one side at least: inside (p, q) -> (p, q + 1),
    closed: (p, q)."""
    if closed:
        return inside | np.roll(inside, 1, axis=1)
    wide = np.zeros((inside.shape[0], inside.shape[1] + 1), dtype=bool)
    wide[:, :-1] |= inside
    wide[:, 1:] |= inside
    return wide


FEWEST = 4
"""Knots of a row all round a closed direction."""


@dataclass(eq=False)
class Draft:
    """A T-mesh that is being changed: the fields of `TMesh`, with a grid of vertex numbers (`crossings`, -1:
    none) instead of the vertices. Axis 0 is s, axis 1 is t."""

    knots: list[Float[ndarray, " _"]]
    edges: list[Bool[ndarray, "_ _"]]
    inside: Bool[ndarray, "_ _"]
    crossings: Int64[ndarray, "_ _"]
    period: tuple[float, float]

    @classmethod
    def of(cls, tmesh: TMesh) -> "Draft":
        """A draft of the T-mesh as it is."""
        edges = [tmesh.along_s.copy(), tmesh.along_t.copy()]
        return cls([tmesh.s_lines, tmesh.t_lines], edges, tmesh.inside.copy(), tmesh.crossings.copy(), tmesh.period)

    def tmesh(self) -> TMesh:
        """The finished T-mesh; vertices keep their numbers."""
        self._fill_rings()
        i, j = np.nonzero(self.crossings >= 0)
        order = np.argsort(self.crossings[i, j])
        (s, t), (along_s, along_t) = self.knots, self.edges
        return TMesh(
            s_lines=s,
            t_lines=t,
            vertices=np.column_stack([i, j])[order],
            along_s=along_s,
            along_t=along_t,
            inside=self.inside,
            period=self.period,
        )

    def insert_lines(self, axis: int, knots: Float[ndarray, " k"]) -> Int64[ndarray, " _"]:
        """Add lines without edges at knots that no line has; the new number of every old line."""
        old = self.knots[axis]
        before = np.searchsorted(old, knots, side="right")
        self.knots[axis] = np.insert(old, before, knots)
        pieces = before - 1
        self.edges[axis] = np.insert(self.edges[axis], before, self.edges[axis].take(pieces, axis=axis), axis=axis)
        self.edges[1 - axis] = np.insert(self.edges[1 - axis], before, False, axis=axis)
        self.inside = np.insert(self.inside, before, self.inside.take(pieces, axis=axis), axis=axis)
        self.crossings = np.insert(self.crossings, before, -1, axis=axis)
        numbers = np.arange(len(old))
        return numbers + np.searchsorted(np.sort(before), numbers, side="right")

    def line_at(self, axis: int, knot: float) -> int:
        """The line with this knot, where several have it the one with most vertices."""
        lines = np.flatnonzero(self.knots[axis] == knot)
        vertices = (self.crossings >= 0).sum(axis=1 - axis)[lines]
        return int(lines[np.argmax(vertices)])

    def cut(self, axis: int, line: int, piece: int) -> None:
        """Draw an edge on `line` of `axis` (0: s = const) from its piece `piece` to the next edges, and on
        through empty intervals."""
        count = self.inside.shape[1 - axis]
        closed = bool(self.period[1 - axis])
        if not self._has_domain_beside(axis, line, piece):
            return
        self._add_edge(axis, line, piece)
        for sign in (-1, 1):
            k = piece
            walked = 0
            while walked < count:
                end = (k if sign < 0 else k + 1) % self.crossings.shape[1 - axis]
                stopped = self._join_edge(axis, line, end)
                k = k + sign
                walked += 1
                if closed:
                    k %= count
                elif not 0 <= k < count:
                    break
                if not self._has_domain_beside(axis, line, k) or (stopped and self._length(1 - axis, k) > 0):
                    break
                self._add_edge(axis, line, k)

    def add_vertex(self, axis: int, line: int, row: int) -> None:
        """A vertex where `line` of `axis` meets the other axis' line `row`, on an edge there or by cutting
        the face along `line`."""
        place = (line, row) if axis == 0 else (row, line)
        if self.crossings[place] >= 0:
            return
        if self._edge_passes(1 - axis, row, line) or self._edge_passes(axis, line, row):
            self._number_vertex(place)

            # Cut the empty intervals on both sides of a new vertex, so that all lines of a clamped border have it
            count = self.inside.shape[1 - axis]
            closed = bool(self.period[1 - axis])
            for piece in (row - 1, row):
                if (closed or 0 <= piece < count) and self._length(1 - axis, piece % count) == 0:
                    self.cut(axis, line, piece % count)
        else:
            self.cut(axis, line, row % self.inside.shape[1 - axis])

    def _fill_rings(self) -> None:
        """Draw each row that passes all round a closed direction with vertices but too few knots as a ring
        with more."""
        for axis, (hits, passes) in enumerate(sight(self.crossings >= 0, self.edges, self.inside, self.period)):
            vertex = self.crossings >= 0 if axis == 0 else self.crossings.T >= 0
            short = (hits.sum(axis=0) < FEWEST) & vertex.any(axis=0) & passes.all(axis=0)
            for row in np.flatnonzero(short).tolist() if self.period[axis] else ():
                self.edges[axis][(slice(None), row) if axis == 0 else (row, slice(None))] = True
                for line in (k * len(hits) // FEWEST for k in range(FEWEST)):
                    if not hits[line, row]:
                        self._number_vertex((line, row) if axis == 0 else (row, line))

    def _length(self, axis: int, piece: int) -> float:
        """The knot interval of a piece between two lines of `axis`."""
        knots = self.knots[axis]
        after = knots[piece + 1] if piece + 1 < len(knots) else knots[0] + self.period[axis]
        return float(after - knots[piece])

    def _has_domain_beside(self, axis: int, line: int, piece: int) -> bool:
        """Whether a piece of a line has the domain on either side."""
        cells = self.inside if axis == 0 else self.inside.T
        beside = [k % cells.shape[0] if self.period[axis] else k for k in (line - 1, line)]
        return all(0 <= k < cells.shape[0] and bool(cells[k, piece]) for k in beside)

    def _add_edge(self, axis: int, line: int, piece: int) -> None:
        """Add the edge on a piece of `line` of `axis`: one on an s-line runs along t, one on a t-line along
        s."""
        self.edges[1 - axis][(line, piece) if axis == 0 else (piece, line)] = True

    def _join_edge(self, axis: int, line: int, row: int) -> bool:
        """Add a vertex where a cut along `line` meets an edge on the other axis' line `row`; whether it
        does."""
        place = (line, row) if axis == 0 else (row, line)
        if self.crossings[place] >= 0:
            return True
        if self._edge_passes(1 - axis, row, line):
            self._number_vertex(place)
            return True
        return False

    def _edge_passes(self, axis: int, line: int, row: int) -> bool:
        """Whether an edge on `line` of `axis` runs through its crossing with `row`."""
        pieces = self.edges[1 - axis] if axis == 0 else self.edges[0].T
        count = pieces.shape[1]
        before = (row - 1) % count if self.period[1 - axis] else row - 1
        after = row
        return before >= 0 and after < count and bool(pieces[line, before] and pieces[line, after])

    def _number_vertex(self, place: Sequence[int]) -> None:
        """Add a vertex at a crossing, with the next number."""
        self.crossings[place[0], place[1]] = self.crossings.max() + 1


STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Steps in lines of s and t of the directions 0 +s, 1 +t, 2 -s, 3 -t."""


class Junctions(NamedTuple):
    """Vertices that are T-junctions and the direction of the missing edge: 0 +s, 1 +t, 2 -s, 3 -t."""

    vertices: Int64[ndarray, " j"]
    directions: Int64[ndarray, " j"]


def _around(tmesh: TMesh, pieces_s: ndarray, pieces_t: ndarray) -> ndarray:
    """The values of the pieces between crossings on the four sides of each vertex, (n, 4); False where there
    is no piece. `pieces_s` run along s, `pieces_t` along t."""
    sides = np.zeros((tmesh.size, 4), dtype=bool)
    for direction, (di, dj) in enumerate(STEPS):
        pieces = (pieces_s, pieces_t)[direction % 2]
        place = tmesh.vertices + np.minimum([di, dj], 0)
        for axis in (0, 1):
            if tmesh.period[axis]:
                place[:, axis] %= pieces.shape[axis]
        there = ((place >= 0) & (place < pieces.shape)).all(axis=1)
        sides[there, direction] = pieces[tuple(place[there].T)]
    return sides


def junctions(tmesh: TMesh) -> Junctions:
    """All T-junctions. Vertices with the same two knots are one: an edge that goes on from any of them is not
    missing."""
    # Whether an edge leaves each vertex in the directions +s, +t, -s, -t, (n, 4)
    edges = _around(tmesh, tmesh.along_s, tmesh.along_t)
    inside = _around(
        tmesh, beside(tmesh.inside, bool(tmesh.period[1])), beside(tmesh.inside.T, bool(tmesh.period[0])).T
    )
    s, t = tmesh.s_lines[tmesh.vertices[:, 0]], tmesh.t_lines[tmesh.vertices[:, 1]]
    place = np.unique(np.column_stack([s, t]), axis=0, return_inverse=True)[1].ravel()
    leaving = np.zeros((int(place.max()) + 1, 4), dtype=bool)
    np.logical_or.at(leaving, place, edges & _positive_intervals(tmesh))
    missing = ~edges & inside & (edges.sum(axis=1) == 3)[:, None] & ~leaving[place]
    vertices, directions = np.nonzero(missing)
    first = np.sort(np.unique(4 * place[vertices] + directions, return_index=True)[1])
    return Junctions(vertices[first], directions[first])


def _positive_intervals(tmesh: TMesh) -> ndarray:
    """Whether the knot intervals on the four sides of each vertex are positive, (n, 4)."""
    s, t = tmesh.intervals
    return _around(
        tmesh,
        np.repeat((s > 0)[:, None], len(tmesh.t_lines), axis=1),
        np.repeat((t > 0)[None], len(tmesh.s_lines), axis=0),
    )


class Extensions(NamedTuple):
    """Extensions of T-junctions: segments from `low` to `high` on the line `across`, all knots; `vertices`
    are the T-junctions."""

    across: Float[ndarray, " e"]
    low: Float[ndarray, " e"]
    high: Float[ndarray, " e"]
    vertices: Int64[ndarray, " e"]


def extensions(tmesh: TMesh) -> tuple[Extensions, Extensions]:
    """The extensions along s and those along t."""
    vertices, directions = junctions(tmesh)
    by_axis = []
    for axis in (0, 1):
        here = directions % 2 == axis
        v = vertices[here]
        forward = directions[here] < 2
        knots = tmesh.local_knots[axis][v]
        other = tmesh.local_knots[1 - axis][v]
        low = np.where(forward, knots[:, 1], knots[:, 0])
        high = np.where(forward, knots[:, 4], knots[:, 3])
        by_axis.append(Extensions(other[:, 2], low, high, v))
    return by_axis[0], by_axis[1]


def meetings(tmesh: TMesh) -> tuple[Int64[ndarray, "c 2"], Int64[ndarray, "d 2"]]:
    """Pairs of T-junctions whose extensions cross inside both, and pairs whose extensions only touch at an
    end of one; the extension along s comes first."""
    along_s, along_t = extensions(tmesh)
    crossing = [np.zeros((0, 2), dtype=np.int64)]
    touching = [np.zeros((0, 2), dtype=np.int64)]
    for ds in _shifts(tmesh.period[0]):
        for dt in _shifts(tmesh.period[1]):
            x = (along_t.across + ds)[None]
            y = along_s.across[:, None]
            low, high = along_s.low[:, None], along_s.high[:, None]
            below, above = (along_t.low + dt)[None], (along_t.high + dt)[None]
            meet = (low <= x) & (x <= high) & (below <= y) & (y <= above)
            inner = (low < x) & (x < high) & (below < y) & (y < above)
            for pairs, which in ((crossing, inner), (touching, meet & ~inner)):
                i, j = np.nonzero(which)
                pairs.append(np.column_stack([along_s.vertices[i], along_t.vertices[j]]))
    return np.concatenate(crossing), np.concatenate(touching)


def _shifts(period: float) -> list[float]:
    """Shifts by whole periods at which extensions may meet; none but 0 in an open direction."""
    return [-period, 0.0, period] if period else [0.0]


@dataclass(frozen=True, eq=False)
class ExtractedTMesh:
    """`size` functions, of which functions[starts[e]:starts[e+1]] live on element e with Bernstein
    coefficients (k, c), s fastest."""

    size: int
    starts: Int64[ndarray, " e1"]
    functions: Int64[ndarray, " k"]
    coefficients: Float[ndarray, "k c"]

    @property
    def poles(self) -> tuple[bool, bool]:
        """There is no common direction that could have poles."""
        return False, False

    @property
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[0, 2 e - 1], [0, 1]]: with gaps between the elements."""
        return self.elements.domain

    @cached_property
    def elements(self) -> Elements:
        """The Bezier elements, side by side."""
        low = 2.0 * np.arange(len(self.starts) - 1)
        boxes = np.column_stack([low, low + 1, np.zeros_like(low), np.ones_like(low)])
        return Elements(boxes, self.starts, self.functions, self.coefficients)


PAIRS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


@dataclass(frozen=True, eq=False)
class OpenRowTMesh:
    """Rows j = 0..m-1 over t_knots (m+4,), row j with s_knots[j] (its control points + 4), 0 and 1 four times
    at the ends."""

    t_knots: Float[ndarray, " k"]
    s_knots: tuple[Float[ndarray, " _"], ...]

    @classmethod
    def from_rows(cls, t_knots: ndarray, s_knots: Sequence[ndarray]) -> "OpenRowTMesh":
        """Check and freeze. Raises ValueError on knots that decrease or are not clamped, and on wrong
        counts."""
        t = frozen(t_knots)
        if len(t) != len(s_knots) + 4 or fault(t) or not _clamped(t):
            raise ValueError(
                f"{len(s_knots)} open rows need {len(s_knots) + 4} t-knots that never decrease, both "
                f"ends four times{fault(t)}"
            )
        for j, row in enumerate(s_knots):
            if len(row) < 8 or fault(row) or not _clamped(row) or row[0] != 0 or row[-1] != 1:
                raise ValueError(
                    f"row {j}: an open row needs knots that never decrease, 0 and 1 four times at the ends{fault(row)}"
                )
        return cls(t, tuple(frozen(row) for row in s_knots))

    @property
    def row_starts(self) -> ndarray:
        """Index of the first control point of each row, and the total behind the last: (m+1,)."""
        return np.concatenate([[0], np.cumsum([len(row) - 4 for row in self.s_knots])])

    @property
    def size(self) -> int:
        """Number of control points."""
        return sum(len(row) - 4 for row in self.s_knots)

    @property
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[s_low, s_high], [t_low, t_high]]."""
        return np.array([[0.0, 1.0], [self.t_knots[3], self.t_knots[-4]]])

    @property
    def poles(self) -> tuple[bool, bool]:
        """No end of t is one point."""
        return False, False

    @cached_property
    def elements(self) -> Elements:
        """The Bezier elements: on a t-span they end where one of its four rows has a knot."""
        spans = np.flatnonzero(np.diff(self.t_knots) > 0)
        boxes, counts, functions, coefficients = (
            np.concatenate(parts) for parts in zip(*(self._strip(int(k)) for k in spans))
        )
        return Elements(boxes, np.concatenate([[0], np.cumsum(counts)]), functions, coefficients)

    def blending(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int) -> list[sp.csr_array]:
        """B, and up to `order` B_s, B_t, B_ss, B_st, B_tt: sparse (n, size)."""
        pairs = PAIRS[: (1, 3, 6)[order]]
        span, along = _functions(self.t_knots, t, order)
        matrices = [sp.lil_array((len(s), self.size)) for _ in pairs]
        starts = self.row_starts
        for j, knots in enumerate(self.s_knots):
            here = np.flatnonzero((span - 3 <= j) & (j <= span))
            if not len(here):
                continue
            first, around = _functions(knots, s[here], order)
            columns = starts[j] + first[:, None] + np.arange(-3, 1)
            for matrix, (a, b) in zip(matrices, pairs):
                matrix[here[:, None], columns] = around[a] * along[b, here, j - span[here] + 3][:, None]
        return [sp.csr_array(matrix) for matrix in matrices]

    def _strip(self, k: int) -> tuple[ndarray, ...]:
        """Boxes, function counts, function ids and coefficients of the elements on t-span k."""
        rows = range(k - 3, k + 1)
        starts = self.row_starts
        breaks = distinct(np.concatenate([self.s_knots[j] for j in rows]))
        low, high = breaks[:-1], breaks[1:]
        along = bernstein_coefficients(self.t_knots[None, k - 3 : k + 5], self.t_knots[[k]], self.t_knots[[k + 1]])[0]
        ids = []
        values = []
        for j in rows:
            span = _span(self.s_knots[j], (low + high) / 2)
            around = bernstein_coefficients(self.s_knots[j][span[:, None] + np.arange(-3, 5)], low, high)
            values.append((along[j - k + 3][None, None, :, None] * around[:, :, None, :]).reshape(len(low), 4, 16))
            ids.append(starts[j] + span[:, None] + np.arange(-3, 1))
        boxes = np.column_stack([low, high, np.full_like(low, self.t_knots[k]), np.full_like(low, self.t_knots[k + 1])])
        return (
            boxes,
            np.full(len(low), 16),
            np.concatenate(ids, axis=1).ravel(),
            np.concatenate(values, axis=1).reshape(-1, 16),
        )


def _clamped(knots: ndarray) -> bool:
    """Whether knots never decrease, end in fourfold knots and have no other knot more than three times."""
    return bool(
        (np.diff(knots) >= 0).all()
        and (knots[:4] == knots[0]).all()
        and (knots[-4:] == knots[-1]).all()
        and len(knots) >= 8
        and (knots[4:] > knots[:-4]).all()
    )


def _span(knots: ndarray, x: ndarray) -> ndarray:
    """The span of clamped knots that holds x; the last one holds the end too."""
    return np.clip(np.searchsorted(knots, x, side="right") - 1, 3, len(knots) - 5)


def _functions(knots: ndarray, x: ndarray, order: int) -> tuple[ndarray, ndarray]:
    span = _span(knots, x)
    return span, span_functions(knots[span[:, None] + np.arange(-3, 5)], x, order)


NEAREST = 1e-12
"""Share of the range: knots that differ by less differ by rounding only."""


@dataclass(frozen=True, eq=False)
class RowTMesh:
    """Rows j = 0..m-1 over t_knots (m+4,), row j with the distinct periodic knots s_knots[j] in [0, 1)."""

    t_knots: Float[ndarray, " k"]
    s_knots: tuple[Float[ndarray, " _"], ...]

    @classmethod
    def from_rows(cls, t_knots: ndarray, s_knots: Sequence[ndarray]) -> "RowTMesh":
        """Check and freeze. Raises ValueError on decreasing knots, fewer than four knots in a closed row,
        wrong counts."""
        t = frozen(t_knots)
        if len(t) < 8 or len(t) != len(s_knots) + 4:
            raise ValueError(f"{len(s_knots)} rows (four or more) need {len(s_knots) + 4} t-knots, not {len(t)}")
        if fault(t):
            raise ValueError(f"t-knots must never decrease{fault(t)}")
        steps = np.diff(t)[(np.diff(t) > 0)]
        if (
            not (t[4:] > t[:-4]).all()
            or not 1 / LARGEST < steps.min() <= np.abs(t).max() < LARGEST
            or steps.min() < NEAREST * np.ptp(t)
        ):
            raise ValueError("t-knots must repeat four times at most and else differ by more than rounding")
        for j, row in enumerate(s_knots):
            if len(row) in (0, 2, 3) or not (
                row[0] >= 0 and row[-1] < 1 and (np.diff(row, append=row[0] + 1) > NEAREST).all()
            ):
                raise ValueError(
                    f"row {j}: a closed row needs four or more increasing knots in [0, 1), a pole one{fault(row)}"
                )
        return cls(t, tuple(frozen(row) for row in s_knots))

    @property
    def row_starts(self) -> ndarray:
        """Index of the first control point of each row, and the total behind the last: (m+1,)."""
        return np.concatenate([[0], np.cumsum([len(row) for row in self.s_knots])])

    @property
    def size(self) -> int:
        """Number of control points."""
        return sum(len(row) for row in self.s_knots)

    @property
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[s_low, s_high], [t_low, t_high]]; s is periodic."""
        return np.array([[0.0, 1.0], [self.t_knots[3], self.t_knots[-4]]])

    @property
    def poles(self) -> tuple[bool, bool]:
        """Whether the lower and the upper end of t is one point."""
        return len(self.s_knots[0]) == 1, len(self.s_knots[-1]) == 1

    @cached_property
    def elements(self) -> Elements:
        """The Bezier elements."""
        return extract_rows(self.t_knots, self.s_knots)

    def blending(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int) -> list[sp.csr_array]:
        """B, and up to `order` B_s, B_t, B_ss, B_st, B_tt: sparse (n, size)."""
        s = np.mod(s, 1.0)
        pairs = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)][: (1, 3, 6)[order]]
        span = np.clip(np.searchsorted(self.t_knots, t, side="right") - 1, 3, len(self.t_knots) - 5)
        along = span_functions(self.t_knots[span[:, None] + np.arange(-3, 5)], t, order)
        starts = self.row_starts
        rows: list[ndarray] = []
        columns: list[ndarray] = []
        values: list[list[ndarray]] = [[] for _ in pairs]
        for j, knots in enumerate(self.s_knots):
            here = np.flatnonzero((span - 3 <= j) & (j <= span))
            if not len(here):
                continue
            around, index = self._row_functions(knots, s[here], order)
            local = j - span[here] + 3
            rows.append(np.repeat(here, index.shape[1]))
            columns.append((starts[j] + index).ravel())
            for k, (a, b) in enumerate(pairs):
                values[k].append((around[a] * along[b, here, local][:, None]).ravel())
        shape = (len(s), self.size)
        where = (np.concatenate(rows), np.concatenate(columns))
        return [sp.csr_array((np.concatenate(v), where), shape=shape) for v in values]

    @staticmethod
    def _row_functions(knots: ndarray, s: ndarray, order: int) -> tuple[ndarray, ndarray]:
        """Values (order+1, n, 4) of the row's functions that live at s, and which they are (n, 4); a pole:
        (.., n, 1)."""
        if len(knots) == 1:
            values = np.zeros((order + 1, len(s), 1))
            values[0] = 1.0
            return values, np.zeros((len(s), 1), dtype=np.int64)
        count = len(knots)
        span = np.searchsorted(knots, s, side="right") - 1
        window = span[:, None] + np.arange(-3, 5)
        unwrapped = knots[window % count] + window // count

        return span_functions(unwrapped, s, order), (span[:, None] + np.arange(-1, 3)) % count


M = TypeVar("M", bound=RowTMesh | OpenRowTMesh | TMesh | ExtractedTMesh)


class Seeds(NamedTuple):
    """Surface points from which the search for closest points starts."""

    parameters: Float[ndarray, "n 2"]
    """(s, t) of the points."""
    tree: KDTree
    """The points in mm, for the nearest of them."""
    step_limit: Float[ndarray, "2"]
    """Longest step of the search in s and in t: about two spacings of the points."""


class Surface(ABC, Generic[M]):
    """A rational spline S(s, t) over a T-mesh of any kind: control points (n, 3) in mm, weights (n,)."""

    tmesh: M
    control_points: Float[ndarray, "n 3"]
    weights: Float[ndarray, " n"]

    @property
    @abstractmethod
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[s_low, s_high], [t_low, t_high]]; s is periodic where the surface is closed."""

    @property
    @abstractmethod
    def poles(self) -> tuple[bool, bool]:
        """Whether the lower and the upper end of t is one point of a surface that is closed in s."""

    @property
    @abstractmethod
    def patches(self) -> Float[ndarray, "e c 4"]:
        """Homogeneous Bezier control points (w x, w y, w z, w) of every element, s fastest."""

    @property
    @abstractmethod
    def seeds(self) -> Seeds:
        """Surface points from which the search for closest points starts."""

    @abstractmethod
    def elements(self) -> Elements:
        """The Bezier elements of the T-mesh: boxes, function ids, coefficients."""

    @abstractmethod
    def basis(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int = 0) -> tuple[sp.csr_array, ...]:
        """R, then R_s, R_t (order 1), then R_ss, R_st, R_tt (order 2): sparse (n, control points)."""

    @abstractmethod
    def positions(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Surface points S(s, t) in mm."""

    @abstractmethod
    def derivatives(
        self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int
    ) -> tuple[Float[ndarray, "n 3"], ...]:
        """S, S_s, S_t (order 1) and S_ss, S_st, S_tt (order 2)."""

    @abstractmethod
    def normals(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Outward unit normals; at a pole their limit."""

    @abstractmethod
    def with_control_points(self: "S", control_points: Float[ndarray, "n 3"]) -> "S":
        """The surface of the same T-mesh and weights with other control points."""

    @abstractmethod
    def with_tmesh(self: "S", tmesh: Any, control_points: Float[ndarray, "n 3"], weights: Float[ndarray, " n"]) -> "S":
        """The surface of another T-mesh of the same kind."""


S = TypeVar("S", bound=Surface)
"""A class of surfaces: what is returned is of the class that was given."""
