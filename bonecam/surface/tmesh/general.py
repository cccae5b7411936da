"""The general T-mesh in index space: T-, I- and L-junctions, domains that are not rectangles, open and closed
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
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int64
from numpy import ndarray
from scipy.sparse.csgraph import connected_components

from bonecam.arrays import frozen
from bonecam.errors import SurfaceError
from bonecam.surface.basis.elements import Elements
from bonecam.surface.basis.local_extraction import extract_local


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
