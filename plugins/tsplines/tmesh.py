"""General T-meshes in index space: T-, I- and L-junctions, domains that are not rectangles, open and closed directions.

Index lines of a general T-mesh are numbered in either direction and carry knots that never decrease; a line may repeat
a knot (a clamped border is two lines one of which only borders empty intervals). On this grid a T-mesh is: which
crossings are vertices (each a control point), which pieces between neighbouring crossings are edges, and which cells
belong to the domain. A closed direction has as many cells as lines, the last of them back to line 0 at knot + period.
Faces are the rectangles that edges bound: cells joined where no edge parts them.

Local knot vectors come from ray shooting in index space (Sederberg et al. 2003, Rule 1). From a vertex a ray runs along
its index line and takes the knot of each vertex or perpendicular edge that it hits, two to either side. Where the ray
leaves the domain the last knot repeats; in a closed direction the ray goes round. All comparisons are between line
numbers, so knots that a file holds twice with different last digits are one.

Bezier extraction (Scott et al. 2011): a blending function is B(s, t) = N[s-knots](s) N[t-knots](t), cubic B-splines
each on its own five knots (Gan et al. 2014, Definition 1). On a face it is a polynomial between its own knots only, so
every face is cut into a grid by those knots of all functions that reach it. The functions need not sum to one.

A tessellation starts from the Bezier elements, opposite sides of a closed direction made one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int64
from numpy import ndarray
from scipy.sparse.csgraph import connected_components

from bonecam.arrays import frozen
from bonecam.errors import SurfaceError
from bonecam.mesh import TriangleMesh
from bonecam.surface import (
    Elements,
    Tessellation,
    TSpline,
    bernstein_coefficients,
    corners_of,
    distinct,
    patch_mesh,
    split_to_tolerance,
)

ROUNDING = 1e-12
"""Share of the knots' size: nearer knots of lines must be equal."""

LARGEST = 1e18
"""Knots and the inverse of their range must be smaller, lest derivatives overflow."""

BLOCK = 4_000_000
"""Pairs of a function and a box looked at in one go."""


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
        lines = line[here]
        stops = np.flatnonzero(hits[:, j])
        gaps = np.concatenate([[0], np.cumsum(~passes[:, j])])  # before each line
        if closed and passes[:, j].all():
            if len(stops) < 4:
                raise SurfaceError(
                    f"row {j} of a closed direction has {len(stops)} distinct knots: give it four or more", row=int(j)
                )
            place = np.searchsorted(stops, lines)[:, None] + np.arange(-2, 3)
            result[here] = stops[place % len(stops)] + count * (place // len(stops))
            continue
        shift = 0
        if closed:
            shift = count
            stops = np.concatenate([stops - count, stops, stops + count])
            gaps = np.concatenate([gaps[:-1], gaps[-1] + gaps[:-1], 2 * gaps[-1] + gaps])
        # Two stops to either side of each line, the last one before a gap repeated
        result[here, 2] = lines
        place = np.searchsorted(stops, lines)
        for step in (-1, 1):
            last = lines
            for k in (step, 2 * step):
                index = np.clip(place + k, 0, len(stops) - 1)
                reached = (place + k == index) & (gaps[stops[index] + shift] == gaps[lines + shift])
                last = np.where(reached, stops[index], last)
                result[here, 2 + k] = last
    return result


def knots_of_lines(lines: Int64[ndarray, "n k"], knots: Float[ndarray, " a"], period: float) -> Float[ndarray, "n k"]:
    """Knot values of line numbers, those beyond the ends of a closed direction moved by whole periods."""
    return knots[lines % len(knots)] + period * (lines // len(knots))


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

    poles = (False, False)
    """Whether an end of t is one control point: never here; a pole is a row whose control points coincide."""

    def __post_init__(self) -> None:
        kinds = (np.float64, np.float64, np.int64, np.bool_, np.bool_, np.bool_)
        for name, kind in zip(("s_lines", "t_lines", "vertices", "along_s", "along_t", "inside"), kinds):
            object.__setattr__(self, name, frozen(getattr(self, name), kind))
        for letter, lines, period in zip("st", (self.s_lines, self.t_lines), self.period):
            steps = np.diff(lines)
            if len(lines) < 2 or not np.isfinite(lines).all() or (steps < 0).any():
                k = int(np.argmax(~(steps >= 0))) + 1 if len(lines) > 1 else 0
                raise SurfaceError(
                    f"the knot of {letter}-line {k} is less than the one before: knots must not decrease", line=k
                )
            if not (max(np.ptp(lines), period) > 1 / LARGEST and max(np.abs(lines).max(), period) < LARGEST):
                raise SurfaceError(
                    f"the knots in {letter} are all equal, or their range is not between {1 / LARGEST:g} and "
                    f"{LARGEST:g}"
                )
            close = (steps > 0) & (steps < ROUNDING * max(np.ptp(lines), np.abs(lines).max()))
            if close.any():
                k = int(np.argmax(close)) + 1
                raise SurfaceError(
                    f"the knots of {letter}-lines {k - 1} and {k} differ by rounding only: make them equal", line=k
                )
            if period < 0 or (period and not period > np.ptp(lines)):
                raise SurfaceError(
                    f"the period of {letter} must be longer than its knots' range {np.ptp(lines)}, not {period}"
                )
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
        along_s, along_t = sight(self.crossings >= 0, (self.along_s, self.along_t), self.inside, self.period)
        return local_lines(i, j, *along_s, bool(self.period[0])), local_lines(j, i, *along_t, bool(self.period[1]))

    @cached_property
    def local_knots(self) -> tuple[Float[ndarray, "n 5"], Float[ndarray, "n 5"]]:
        """The local knot vectors in s and in t of every vertex."""
        s, t = self.knot_lines
        return knots_of_lines(s, self.s_lines, self.period[0]), knots_of_lines(t, self.t_lines, self.period[1])

    @cached_property
    def faces(self) -> Int64[ndarray, "f 4"]:
        """First and last s-line, first and last t-line of every face with an area; one across a seam counts
        as two that end there.

        Raises SurfaceError for a face that is not a rectangle. Only the part of it that has an area must be one: at a
        clamped corner that turns inwards empty cells are missing.
        """
        inside = self.inside
        p, q = inside.shape
        cell = np.arange(p * q).reshape(p, q)
        joined_s = inside[:-1] & inside[1:] & ~self.along_t[1:p, :q]
        joined_t = inside[:, :-1] & inside[:, 1:] & ~self.along_s[:p, 1:q]
        a = np.concatenate([cell[:-1][joined_s], cell[:, :-1][joined_t]])
        b = np.concatenate([cell[1:][joined_s], cell[:, 1:][joined_t]])
        graph = sp.coo_array((np.ones(len(a)), (a, b)), shape=(p * q, p * q))
        label = connected_components(graph, directed=False)[1].reshape(p, q)
        widths, heights = self.intervals
        counted = inside & (widths > 0)[:, None] & (heights > 0)
        kinds, group = np.unique(label[counted], return_inverse=True)
        low = np.full((2, len(kinds)), p + q)
        high = np.full((2, len(kinds)), -1)
        for k, index in enumerate(np.nonzero(counted)):
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

    @property
    def intervals(self) -> tuple[Float[ndarray, " p"], Float[ndarray, " q"]]:
        """Knot intervals between neighbouring lines, in a closed direction the one across the seam last."""
        lines = zip((self.s_lines, self.t_lines), self.period)
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
        elements = _extract(self.face_boxes, *self.local_knots, self.period)
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

    def refine(
        self, surface: TSpline["TMesh"], s: Float[ndarray, " n"], t: Float[ndarray, " n"], directions: str
    ) -> TSpline["TMesh"]:
        """The unchanged surface over this T-mesh with the faces that hold samples cut, as `TSpline.refine` wants it."""
        from bonecam_plugins.tsplines.refinement import cut_faces

        return cut_faces(surface, s, t, directions)

    def tessellate(
        self, surface: TSpline["TMesh"], chord_tolerance: float, angle_tolerance: float | None, most_vertices: int
    ) -> Tessellation:
        """The surface over this T-mesh as triangles, as `TSpline.tessellate` wants them."""
        # The mesh of all elements that a tessellation starts from, opposite sides of a closed direction made one.
        elements = surface.elements()
        # Boxes halved until none is too wide for a closed direction; neighbours need not agree.
        boxes = elements.boxes
        for axis in (0, 1):
            while elements.period[axis]:
                low = boxes[:, 2 * axis]
                high = boxes[:, 2 * axis + 1]
                wide = high - low > WIDEST * elements.period[axis]
                if not wide.any():
                    break
                first, second = boxes[wide].copy(), boxes[wide].copy()
                first[:, 2 * axis + 1] = second[:, 2 * axis] = (low + high)[wide] / 2
                boxes = np.vstack([boxes[~wide], first, second])
        corners = corners_of(boxes)
        for axis in (0, 1):
            if elements.period[axis]:
                low, end = elements.domain[axis]
                last = np.abs(corners[:, axis] - end) <= ROUNDING * np.abs(elements.domain).max()
                corners[last, axis] = low
        start = patch_mesh(surface, boxes, corners)
        return outward(split_to_tolerance(surface, start, chord_tolerance, angle_tolerance, most_vertices))


def sight(
    vertex: ndarray, edges: Sequence[ndarray], inside: ndarray, period: tuple[float, float]
) -> list[tuple[ndarray, ndarray]]:
    """For rays along s and along t: where something stops them (line, row), a vertex or an edge that runs on through
    the crossing, and where they may pass (piece, row), along an edge or beside the domain."""
    return [
        (stops | beside(across, closed, np.logical_and), along | beside(cells, closed))
        for along, across, cells, stops, closed in (
            (edges[0], edges[1], inside, vertex, bool(period[1])),
            (edges[1].T, edges[0].T, inside.T, vertex.T, bool(period[0])),
        )
    ]


def beside(pieces: ndarray, closed: bool, joined: np.ufunc = np.logical_or) -> ndarray:
    """What is true of a piece before or (`joined`) after each crossing: pieces (p, q) -> (p, q + 1), closed: (p, q)."""
    if closed:
        return joined(pieces, np.roll(pieces, 1, axis=1))
    return joined(np.pad(pieces, ((0, 0), (0, 1))), np.pad(pieces, ((0, 0), (1, 0))))


def _extract(faces: ndarray, s_knots: ndarray, t_knots: ndarray, period: tuple[float, float]) -> Elements:
    """The elements of the faces (s_low, s_high, t_low, t_high) under functions with these local knots (n, 5).

    In a closed direction (period > 0) functions act again one period on.
    """
    # The functions and their images one and two periods away that may reach the domain
    shifts = [np.arange(-2, 3) * length if length else np.zeros(1) for length in period]
    moved = [(s_knots + a, t_knots + b, np.arange(len(s_knots))) for a in shifts[0] for b in shifts[1]]
    s, t, ids = (np.concatenate([part[k] for part in moved]) for k in range(3))

    # Each face cut into a grid by the knots of the functions that reach it
    function, face = _overlaps(faces, s, t)
    order = np.argsort(face, kind="stable")
    function = function[order]
    starts = np.searchsorted(face[order], np.arange(len(faces) + 1))
    lines = [_lines(faces[:, :2], s), _lines(faces[:, 2:], t)]
    cut = []
    for k, (s_low, s_high, t_low, t_high) in enumerate(faces):
        here = function[starts[k] : starts[k + 1]]
        x, y = (
            _nearest(every, np.concatenate([[low, high], np.clip(knots[here].ravel(), low, high)]))
            for every, knots, low, high in ((lines[0], s, s_low, s_high), (lines[1], t, t_low, t_high))
        )
        i, j = (index.ravel() for index in np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1)))
        cut.append(np.column_stack([x[i], x[i + 1], y[j], y[j + 1]]))
    boxes = np.vstack(cut)

    s_middle, t_middle = boxes[:, :2].mean(axis=1), boxes[:, 2:].mean(axis=1)
    function, element = _overlaps(
        np.column_stack([s_middle, s_middle, t_middle, t_middle]), s, t
    )  # images are off by a rounding
    low, high = boxes[element][:, [0, 2]], boxes[element][:, [1, 3]]
    around, along = (_coefficients(k[function], low[:, d], high[:, d]) for d, k in ((0, s), (1, t)))
    values = (along[:, :, None] * around[:, None, :]).reshape(-1, 16)

    # Elements with the images of one function added up and functions in increasing order
    functions = ids[function]
    key = element * (functions.max() + 1) + functions
    unique, inverse = np.unique(key, return_inverse=True)
    if len(unique) < len(key):
        summed = np.zeros((len(unique), 16))
        np.add.at(summed, inverse, values)
    else:
        summed = values[np.argsort(key)]
    owner, functions = np.divmod(unique, functions.max() + 1)
    return Elements(boxes, np.searchsorted(owner, np.arange(len(boxes) + 1)), functions, summed, period)


def _lines(sides: ndarray, knots: ndarray) -> ndarray:
    """All places where a box may end: the sides of faces, and knots that do not differ from them by rounding
    only."""
    sides = np.unique(sides)
    every = distinct(np.clip(knots.ravel(), sides[0], sides[-1]))
    slack = 4096 * np.finfo(float).eps * max(1.0, float(np.abs(sides).max()))
    after = np.searchsorted(sides, every)
    apart = np.abs(every - sides[np.clip(after, 0, len(sides) - 1)]) > slack
    apart &= np.abs(every - sides[np.clip(after - 1, 0, None)]) > slack
    return np.sort(np.concatenate([sides, every[apart]]))


def _nearest(lines: ndarray, knots: ndarray) -> ndarray:
    """The lines that are nearest to some of the knots."""
    above = np.clip(np.searchsorted(lines, knots), 1, len(lines) - 1)
    return lines[np.unique(np.where(knots - lines[above - 1] < lines[above] - knots, above - 1, above))]


def _overlaps(boxes: ndarray, s: ndarray, t: ndarray) -> tuple[ndarray, ndarray]:
    """Pairs (function, box) whose insides meet."""
    pairs = []
    step = max(1, BLOCK // max(1, len(s)))
    for first in range(0, len(boxes), step):
        b = boxes[first : first + step, :, None]
        meet = (s[:, 0] < b[:, 1]) & (s[:, 4] > b[:, 0]) & (t[:, 0] < b[:, 3]) & (t[:, 4] > b[:, 2])
        box, function = np.nonzero(meet)
        pairs.append((function, box + first))
    return np.concatenate([f for f, _ in pairs]), np.concatenate([b for _, b in pairs])


def _coefficients(knots: ndarray, low: ndarray, high: ndarray) -> ndarray:
    """Bernstein coefficients (m, 4) of N[knots] on boxes that lie within one of its spans."""
    padded = np.column_stack([*[knots[:, 0] - 1] * 3, knots, *[knots[:, 4] + 1] * 3])
    middle = (low + high) / 2
    span = np.clip((knots <= middle[:, None]).sum(axis=1) - 1, 0, 3)
    window = np.take_along_axis(padded, span[:, None] + np.arange(8), axis=1)
    return bernstein_coefficients(window, low, high)[np.arange(len(knots)), 3 - span]


WIDEST = 0.24
"""Share of a period: what is wider would have two ways round."""


def outward(found: Tessellation) -> Tessellation:
    """The tessellation with its faces outward where it is closed."""
    mesh = found.mesh
    following = mesh.faces[:, [1, 2, 0]].astype(np.int64)
    there = mesh.faces.astype(np.int64) << 32 | following
    back = following << 32 | mesh.faces
    closed = np.array_equal(np.sort(there, axis=None), np.sort(back, axis=None))
    if not closed or mesh.volume >= 0:
        return found
    return replace(found, mesh=TriangleMesh(mesh.vertices, mesh.faces[:, ::-1]))
