"""Knots, B-spline bases and Bezier extraction.

Cubic B-spline basis functions on given knots (Cox-de Boor), many spans at once.

Periodic cubic splines in one parameter on [0, 1): collocation.

A curve is given by its distinct knots (r,) and as many control points (r, d); control point i belongs to the
function that is centred on knot i.

Gauss-Legendre quadrature on knot spans and on Bezier elements.

Bezier elements: the one form in which every T-spline is evaluated (Scott et al. 2011, Bezier extraction).

An element is a box of the parameter domain, the functions that live on it, and for each of them the 16
Bernstein coefficients of its (polynomial) restriction. Nothing downstream needs the T-mesh any more.

Bezier extraction of a row-structured T-spline: from knots to elements.

On the t-span k only the rows k-3..k live, so its elements end where one of those four rows has a knot. A seam
that is not a knot is made an element edge as well: no box wraps round.

Bezier extraction of a T-spline from local knot vectors: faces cut at the knots of the functions that live
on them.

A blending function is B(s, t) = N[s-knots](s) N[t-knots](t), cubic B-splines each on its own five knots (Gan
et al. 2014, Definition 1). On a face it is a polynomial between its own knots only, so every face is cut into
a grid by those knots of all functions that reach it. The functions need not sum to one.

Cubic splines in one parameter on [0, 1], closed or open: collocation, interpolation and knot insertion.

A space is told by its `knots`: closed, the distinct periodic knots in [0, 1), as many control points; open,
the knots inside (0, 1) without the fourfold ends, four control points more. Matrices are sparse: four functions
live at a parameter.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int, Int32, Int64
from numpy import ndarray
from scipy.sparse.linalg import splu

from bonecam.arrays import frozen
from bonecam.errors import SurfaceError
from bonecam.kernels import bezier


def fault(knots: ndarray) -> str:
    """Which knot is not finite, or below the one before it; nothing where none is."""
    if not np.isfinite(knots).all():
        return f": knot {int(np.argmin(np.isfinite(knots)))} is not finite"
    falls = np.flatnonzero(np.diff(knots) < 0)
    return f": knot {falls[0] + 1} ({knots[falls[0] + 1]:g}) is below the one before it" if len(falls) else ""


def _lifted(lower: ndarray, knots: ndarray, x: ndarray, degree: int) -> ndarray:
    """The functions of `degree` on one span from those of `degree - 1`: A2.2 of The NURBS Book,
    vectorised."""
    functions = np.zeros((len(x), degree + 1))
    for i in range(degree):
        left = knots[:, 4 - degree + i]
        right = knots[:, 4 + i]
        ratio = lower[:, i] / (right - left)
        functions[:, i] += ratio * (right - x)
        functions[:, i + 1] += ratio * (x - left)
    return functions


def _differences(lower: ndarray, knots: ndarray, degree: int) -> ndarray:
    """d/dx of the functions of `degree`, given (derivatives of) those of `degree - 1`."""
    functions = np.zeros((len(lower), degree + 1))
    for i in range(degree):
        ratio = degree * lower[:, i] / (knots[:, 4 + i] - knots[:, 4 - degree + i])
        functions[:, i] -= ratio
        functions[:, i + 1] += ratio
    return functions


def span_functions(knots: Float[ndarray, "n 8"], x: Float[ndarray, " n"], order: int) -> Float[ndarray, "c n 4"]:
    """The four cubics that live on the span [knots[:, 3], knots[:, 4]] at x, and their derivatives up to
    `order`.

    Row d holds the d-th derivatives. The span must not be empty.
    """
    one = np.ones((len(x), 1))
    linear = _lifted(one, knots, x, 1)
    quadratic = _lifted(linear, knots, x, 2)
    result = [_lifted(quadratic, knots, x, 3)]
    if order > 0:
        result.append(_differences(quadratic, knots, 3))
    if order > 1:
        result.append(_differences(_differences(linear, knots, 2), knots, 3))
    return np.array(result)


def bernstein_coefficients(
    knots: Float[ndarray, "n 8"], low: Float[ndarray, " n"], high: Float[ndarray, " n"]
) -> Float[ndarray, "n 4 4"]:
    """Bernstein coefficients on [low, high] of the four cubics that live on the span [knots[:, 3], knots[:,
    4]].

    Result[n, f, i]: coefficient i of function f: the blossom of f at (low, low, low), (low, low, high), (low,
    high, high), (high, high, high) (Ramshaw 1989), by de Boor's triangle on the four unit coefficient
    vectors.
    """
    result = np.empty((len(knots), 4, 4))
    for i in range(4):
        points = np.broadcast_to(np.eye(4), (len(knots), 4, 4))  # [n, de Boor point, function]
        for r in (1, 2, 3):
            x = (high if r > 3 - i else low)[:, None]
            left, right = knots[:, r:4], knots[:, 4 : 8 - r]
            ratio = ((x - left) / (right - left))[:, :, None]
            points = points[:, :-1] * (1 - ratio) + points[:, 1:] * ratio
        result[:, :, i] = points[:, 0]
    return result


def aligned(rows: Sequence[Float[ndarray, " _"]], period: float = 0.0) -> list[Float[ndarray, " _"]]:
    """Rows of knots, those that differ by rounding only made equal to the least of them; a knot just below
    the period comes to lie at 0."""
    every = np.unique(np.concatenate(rows))
    kept = distinct(every)
    lifted = distinct(np.append(kept, kept[0] + period)) if period else kept
    values = np.append(kept[:-1], kept[0]) if period and len(lifted) == len(kept) else kept
    return [values[np.searchsorted(kept, row, side="right") - 1] for row in rows]


def distinct(knots: Float[ndarray, " n"]) -> Float[ndarray, " m"]:
    """Increasing knots without those that differ from their neighbour by rounding only."""
    knots = np.unique(knots)
    tolerance = 1024 * np.finfo(float).eps * max(1.0, float(np.abs(knots).max()))
    return knots[np.concatenate([[True], np.diff(knots) > tolerance])]


FEWEST = 4
"""A closed cubic needs four distinct knots."""


def periodic_collocation(knots: Float[ndarray, " r"], s: Float[ndarray, " n"]) -> Float[ndarray, "n r"]:
    """The periodic functions on `knots` at the parameters `s`; one knot means the constant 1."""
    matrix = np.zeros((len(s), len(knots)))
    if len(knots) == 1:
        return matrix + 1.0
    values, functions = functions_at(knots, s)
    np.add.at(matrix, (np.arange(len(s))[:, None], functions), values)
    return matrix


def functions_at(
    knots: Float[ndarray, " r"], s: Float[ndarray, " n"]
) -> tuple[Float[ndarray, "n 4"], Int[ndarray, "n 4"]]:
    """Values at the parameters `s` of the four functions on two or more `knots` that live there, and their numbers."""
    s = np.mod(s, 1.0)
    span, window = spans(knots, s)
    return span_functions(window, s, 0)[0], (span[:, None] + np.arange(-1, 3)) % len(knots)


def spans(knots: Float[ndarray, " r"], s: Float[ndarray, " n"]) -> tuple[Int[ndarray, " n"], Float[ndarray, "n 8"]]:
    """The last knot at or below each parameter in [0, 1), and the four knots round it on either side, unwrapped."""
    span = np.searchsorted(knots, s, side="right") - 1
    window = span[:, None] + np.arange(-3, 5)
    return span, knots[window % len(knots)] + window // len(knots)


CLOSED_FORMS = {1: np.array([0.5]), 2: 0.5 + np.array([-1.0, 1.0]) / np.sqrt(12)}
"""Nodes on [0, 1] of one and two points with equal weights; numpy's two are off in the last digit."""


def unit_rule(count: int) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """`count` nodes on [0, 1] and their weights (sum 1): exact for polynomials of degree 2 count - 1."""
    if count in CLOSED_FORMS:
        return CLOSED_FORMS[count], np.full(count, 1 / count)
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def span_points(breaks: Float[ndarray, " b"], count: int) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """`count` points in every interval between increasing breaks, and their weights (sum: the length)."""
    nodes, weights = unit_rule(count)
    sizes = np.diff(breaks)[:, None]
    return (breaks[:-1, None] + sizes * nodes).ravel(), (sizes * weights).ravel()


def element_points(
    boxes: Float[ndarray, "e 4"], count: int
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s and t of count x count points in every box (s_low, s_high, t_low, t_high), and their weights.

    The points of a box follow one another, s fastest; the weights add up to the area of the boxes.
    """
    nodes, weights = unit_rule(count)
    low = boxes[:, [0, 2]]
    sizes = boxes[:, [1, 3]] - low
    u, v = (x.ravel() for x in np.meshgrid(nodes, nodes))
    s = low[:, :1] + sizes[:, :1] * u
    t = low[:, 1:] + sizes[:, 1:] * v
    areas = np.outer(sizes.prod(axis=1), np.outer(weights, weights).ravel())
    return s.ravel(), t.ravel(), areas.ravel()


SLICES = 256
"""Even slices of the t-range for which a table tells where the search for a strip starts."""

SLOTS = 128
"""Even slices of a strip's s-range for which a table tells where the search for an element starts."""

LARGEST_INT32 = 2**31 - 1
"""Sparse matrices with more entries than this need 64-bit indices."""


@dataclass(frozen=True, eq=False)
class Elements:
    """Boxes (s_low, s_high, t_low, t_high) that tile the domain; functions starts[e]:starts[e+1] live on box
    e.

    coefficients[k] belongs to functions[k]: 4 x 4 Bernstein coefficients, s fastest ((d + 1) x (d + 1) where
    elements of another degree d come from a file; kernels.bezier.any_degree evaluates them). `period` is the
    length of a closed direction (s, t), 0 where it is open. Functions are increasing within an element.
    """

    boxes: Float[ndarray, "e 4"]
    starts: Int64[ndarray, " e1"]
    functions: Int64[ndarray, " k"]
    coefficients: Float[ndarray, "k c"]
    period: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name, dtype in (
            ("boxes", np.float64),
            ("starts", np.int64),
            ("functions", np.int64),
            ("coefficients", np.float64),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))

    @property
    def degree(self) -> int:
        """Degree in s and in t."""
        return math.isqrt(self.coefficients.shape[1]) - 1

    @cached_property
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[s_low, s_high], [t_low, t_high]] round all boxes."""
        b = self.boxes
        return np.array([[b[:, 0].min(), b[:, 1].max()], [b[:, 2].min(), b[:, 3].max()]])

    @cached_property
    def strips(self) -> tuple[ndarray, ...]:
        """The boxes in strips of t, each sorted by s, with tables of where to start searching: see
        kernels.bezier.element_search."""
        knots = np.unique(self.boxes[:, 2:])
        order = np.argsort(self.boxes[:, 0], kind="stable")
        first = np.searchsorted(knots, self.boxes[order, 2])
        last = np.searchsorted(knots, self.boxes[order, 3])
        members = [order[(first <= k) & (k < last)] for k in range(len(knots) - 1)]
        starts = np.concatenate([[0], np.cumsum([len(m) for m in members])]).astype(np.int64)
        ids = np.concatenate(members).astype(np.int32)
        lows, highs = self.boxes[ids, 0].copy(), self.boxes[ids, 1].copy()
        table = (
            np.searchsorted(
                knots, np.linspace(knots[0], knots[-1], SLICES, endpoint=False) - 1e-9 * np.ptp(knots), side="right"
            )
            - 1
        )
        tables = np.empty((len(members), SLOTS), dtype=np.int32)
        for k in range(len(members)):
            a = starts[k]
            b = starts[k + 1]
            slots = np.linspace(lows[a], highs[b - 1], SLOTS, endpoint=False) - 1e-9 * (highs[b - 1] - lows[a])
            tables[k] = a + np.clip(np.searchsorted(lows[a:b], slots, side="right") - 1, 0, None)
        return knots, np.clip(table, 0, None).astype(np.int32), starts, lows, highs, ids, tables

    def place(
        self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]
    ) -> tuple[Int32[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
        """The element of each sample and its parameters, wrapped into the domain where a direction is closed.

        A direction that is not closed takes parameters up to a rounding outside and clips them. Raises
        ValueError for parameters that are not finite or lie outside.
        """
        s, t = self._into(s, 0), self._into(t, 1)
        if s.ndim != 1 or s.shape != t.shape:
            raise ValueError(f"s {s.shape} and t {t.shape}: give one of each for every sample, shape (n,)")
        elements = bezier.locate(*self.strips, s, t)
        if len(elements) and elements.min() < 0:
            n = int(np.argmin(elements))
            raise ValueError(f"(s, t) = ({s[n]}, {t[n]}) of sample {n} lies outside the domain")
        return elements, s, t

    def _into(self, x: ndarray, direction: int) -> ndarray:
        low, high = self.domain[direction]
        x = np.ascontiguousarray(x, dtype=np.float64)
        if x.size == 0 or (low <= x.min() and x.max() <= high):
            return x
        if not np.isfinite(x).all():
            raise ValueError(f"parameter {'st'[direction]} of sample {int(np.argmin(np.isfinite(x)))} is not finite")
        if self.period[direction]:
            return low + np.mod(x - low, self.period[direction])
        slack = 64 * np.finfo(float).eps * max(abs(low), abs(high), high - low)
        if x.min() < low - slack or x.max() > high + slack:
            raise ValueError(
                f"{'st'[direction]} must be in [{low}, {high}], not {x.min() if x.min() < low else x.max()}"
            )
        return np.clip(x, low, high)

    def derivatives(
        self,
        patches: Float[ndarray, "e c 4"],
        element: Int32[ndarray, " n"],
        s: Float[ndarray, " n"],
        t: Float[ndarray, " n"],
        order: int,
    ) -> Float[ndarray, "d n 3"]:
        """S; S_s, S_t (order 1); S_ss, S_st, S_tt (order 2) of the elements' patches at parameters inside the
        given elements."""
        derivatives = np.empty(((1, 3, 6)[order], len(s), 3))
        s, t = np.ascontiguousarray(s), np.ascontiguousarray(t)
        if self.degree != 3:
            bezier.derivatives(patches, self.boxes, element=element, s=s, t=t, degree=self.degree, D=derivatives)
        elif order == 0:
            bezier.positions(patches, self.boxes, element=element, s=s, t=t, S=derivatives[0])
        elif order == 1:
            bezier.first_derivatives(patches, self.boxes, element, s, t, *derivatives)
        else:
            bezier.second_derivatives(patches, self.boxes, element=element, s=s, t=t, D=derivatives)
        return derivatives

    def basis(
        self, weights: Float[ndarray, " m"], s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int
    ) -> tuple[sp.csr_array, ...]:
        """The rational basis R; R_s, R_t (order 1); R_ss, R_st, R_tt (order 2): sparse (n, m).

        Raises SurfaceError where the elements are not cubic.
        """
        if self.degree != 3:
            raise SurfaceError(f"the elements have degree {self.degree}: the basis is assembled for cubic ones")
        place, s, t = self.place(s, t)
        ends = np.cumsum(np.diff(self.starts)[place])
        total = int(ends[-1]) if len(ends) else 0
        index_type = np.int64 if total > LARGEST_INT32 else np.int32
        indptr = np.concatenate([[0], ends]).astype(index_type)
        indices = np.empty(total, dtype=index_type)
        values = np.empty(((1, 3, 6)[order], total))
        bezier.basis_values(
            starts=self.starts,
            functions=self.functions,
            coefficients=self.coefficients,
            weights=weights,
            boxes=self.boxes,
            element=place,
            s=s,
            t=t,
            order=order,
            indptr=indptr,
            indices=indices,
            values=values,
        )
        shape = (len(s), len(weights))
        return tuple(sp.csr_array((v, indices.copy(), indptr.copy()), shape=shape) for v in values)

    def patches(self, control_points: Float[ndarray, "n 3"], weights: Float[ndarray, " n"]) -> Float[ndarray, "e c 4"]:
        """Homogeneous Bezier control points of every element."""
        weighted = np.column_stack([control_points * weights[:, None], weights])
        return bezier.homogeneous_patches(self.starts, self.functions, self.coefficients, weighted)


def extract_rows(t_knots: ndarray, s_knots: tuple[ndarray, ...]) -> Elements:
    """The elements of S(s, t) = sum_j N_j(t) Q_j(s), row j periodic over [0, 1) with knots s_knots[j]."""
    row_starts = np.concatenate([[0], np.cumsum([len(row) for row in s_knots])])
    spans = np.flatnonzero(np.diff(t_knots) > 0)
    spans = spans[(spans >= 3) & (spans < len(t_knots) - 4)]
    along = bernstein_coefficients(t_knots[spans[:, None] + np.arange(-3, 5)], t_knots[spans], t_knots[spans + 1])
    breaks = [_breaks(s_knots[k - 3 : k + 1]) for k in spans]
    rows = [_row(knots, strip) for k, strip in zip(spans, breaks) for knots in s_knots[k - 3 : k + 1]]
    windows, low, high = (np.concatenate([row[part] for row in rows]) for part in range(3))
    around = np.split(bernstein_coefficients(windows, low, high), np.cumsum([len(row[0]) for row in rows])[:-1])
    parts = []
    for n, (k, strip) in enumerate(zip(spans, breaks)):
        four = range(4 * n, 4 * n + 4)
        values = [around[i] if len(around[i]) else np.ones((len(strip) - 1, 1, 4)) for i in four]
        ids = [row_starts[k - 3 + i - 4 * n] + rows[i][3] for i in four]
        parts.append(_strip(strip, t_knots[k : k + 2], values, along[n], ids))
    boxes, counts, functions, coefficients = (np.concatenate(part) for part in zip(*parts))
    return Elements(boxes, np.concatenate([[0], np.cumsum(counts)]), functions, coefficients, period=(1.0, 0.0))


def _breaks(rows: tuple[ndarray, ...]) -> ndarray:
    """Where the elements of four rows begin and end, from 0 to 1 exactly: a knot that differs from 1 by rounding is
    the seam."""
    breaks = distinct(np.concatenate([[0.0, 1.0], *(row for row in rows if len(row) > 1)]))
    breaks[-1] = 1.0
    return breaks


def _strip(
    breaks: ndarray, span: ndarray, around: list[ndarray], along: ndarray, ids: list[ndarray]
) -> tuple[ndarray, ...]:
    """Boxes, function counts, function ids and coefficients of the elements on one t-span, from those of its
    four rows."""
    low, high = breaks[:-1], breaks[1:]
    values = [(t[None, None, :, None] * s[:, :, None, :]).reshape(len(low), -1, 16) for s, t in zip(around, along)]
    functions = np.concatenate(ids, axis=1)
    coefficients = np.concatenate(values, axis=1)
    order = np.argsort(functions, axis=1)
    functions = np.take_along_axis(functions, order, axis=1)
    coefficients = np.take_along_axis(coefficients, order[:, :, None], axis=1)
    boxes = np.column_stack([low, high, np.full_like(low, span[0]), np.full_like(low, span[1])])
    return boxes, np.full(len(low), functions.shape[1]), functions.ravel(), coefficients.reshape(-1, 16)


def _row(knots: ndarray, breaks: ndarray) -> tuple[ndarray, ...]:
    """The eight knots round each of a row's elements (n, 8), where these begin and end, and their functions
    (n, f); of a pole the last."""
    low = breaks[:-1]
    high = breaks[1:]
    count = len(knots)
    if count == 1:
        return np.empty((0, 8)), low[:0], high[:0], np.zeros((len(low), 1), dtype=np.int64)
    span = np.searchsorted(knots, (low + high) / 2, side="right") - 1
    window = span[:, None] + np.arange(-3, 5)
    return knots[window % count] + window // count, low, high, (span[:, None] + np.arange(-1, 3)) % count


BLOCK = 4_000_000
"""Pairs of a function and a box looked at in one go."""


def extract_local(
    faces: Float[ndarray, "f 4"],
    s_knots: Float[ndarray, "n 5"],
    t_knots: Float[ndarray, "n 5"],
    period: tuple[float, float],
) -> Elements:
    """The elements of the faces (s_low, s_high, t_low, t_high) under functions with these local knots.

    In a closed direction (period > 0) functions act again one period on.
    """
    # The functions and their images one and two periods away that may reach the domain
    shifts = [np.arange(-2, 3) * length if length else np.zeros(1) for length in period]
    moved = [(s_knots + a, t_knots + b, np.arange(len(s_knots))) for a in shifts[0] for b in shifts[1]]
    s, t, ids = (np.concatenate([part[k] for part in moved]) for k in range(3))

    boxes = _cut(faces, s, t)
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
    owner = unique // (functions.max() + 1)
    starts = np.searchsorted(owner, np.arange(len(boxes) + 1))
    return Elements(boxes, starts, unique % (functions.max() + 1), summed, period)


def _cut(faces: ndarray, s: ndarray, t: ndarray) -> ndarray:
    """Each face cut into a grid by the knots of the functions that reach it."""
    function, face = _overlaps(faces, s, t)
    order = np.argsort(face, kind="stable")
    function = function[order]
    starts = np.searchsorted(face[order], np.arange(len(faces) + 1))
    lines = [_lines(faces[:, :2], s), _lines(faces[:, 2:], t)]
    boxes = []
    for k, (s_low, s_high, t_low, t_high) in enumerate(faces):
        here = function[starts[k] : starts[k + 1]]
        x, y = (
            _nearest(every, np.concatenate([[low, high], np.clip(knots[here].ravel(), low, high)]))
            for every, knots, low, high in ((lines[0], s, s_low, s_high), (lines[1], t, t_low, t_high))
        )
        i, j = (index.ravel() for index in np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1)))
        boxes.append(np.column_stack([x[i], x[i + 1], y[j], y[j + 1]]))
    return np.vstack(boxes)


def _lines(sides: ndarray, knots: ndarray) -> ndarray:
    """All places where a box may end: the sides of faces, and knots that do not differ from them by rounding
    only."""
    sides = np.unique(sides)
    every = distinct(np.clip(knots.ravel(), sides[0], sides[-1]))
    slack = 4096 * np.finfo(float).eps * max(1.0, float(np.abs(sides).max()))
    apart = np.abs(every - sides[np.clip(np.searchsorted(sides, every), 0, len(sides) - 1)]) > slack
    apart &= np.abs(every - sides[np.clip(np.searchsorted(sides, every) - 1, 0, None)]) > slack
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


def clamped(inner: Float[ndarray, " k"]) -> Float[ndarray, " k8"]:
    """The inner knots with 0 and 1 four times at the ends."""
    return np.concatenate([np.zeros(4), inner, np.ones(4)])


def sites(knots: Float[ndarray, " k"], closed: bool) -> Float[ndarray, " n"]:
    """One parameter for each control point at which interpolation is well posed: the knots, or the averages
    of three."""
    return knots if closed else _open_arguments(knots).mean(axis=1)


def collocation(knots: Float[ndarray, " k"], s: Float[ndarray, " n"], closed: bool) -> sp.csr_array:
    """The functions of the space at s: (n, c)."""
    if closed:
        values, functions = functions_at(knots, s)
        return _sparse(values, functions, len(knots))
    span, window = _open_spans(knots, s)
    return _sparse(span_functions(window, s, 0)[0], span[:, None] + np.arange(-3, 1), len(knots) + 4)


def insertion(knots: Float[ndarray, " k"], fine: Float[ndarray, " f"], closed: bool) -> sp.csr_array:
    """The control points on `fine`, which holds all the knots, of a curve on `knots`: (n, c).

    Control point i is the curve's blossom at the three inner knots of function i (Ramshaw 1989), by de Boor's triangle
    on the four unit coefficient vectors.
    """
    at = sites(fine, closed)
    if closed:
        span, window = spans(knots, at)
        functions = (span[:, None] + np.arange(-1, 3)) % len(knots)
        arguments = np.column_stack([np.roll(fine, 1), fine, np.roll(fine, -1)])
        arguments[0, 0] -= 1
        arguments[-1, 2] += 1
    else:
        span, window = _open_spans(knots, at)
        functions = span[:, None] + np.arange(-3, 1)
        arguments = _open_arguments(fine)
    shares = np.broadcast_to(np.eye(4), (len(at), 4, 4))  # [control point, de Boor point, function]
    for r in (1, 2, 3):
        left, right = window[:, r:4], window[:, 4 : 8 - r]
        ratio = ((arguments[:, r - 1, None] - left) / (right - left))[:, :, None]
        shares = shares[:, :-1] * (1 - ratio) + shares[:, 1:] * ratio
    return _sparse(shares[:, 0], functions, len(knots) + 4 * (not closed))


def _open_arguments(knots: ndarray) -> Float[ndarray, "n 3"]:
    """The three inner knots of each function of an open space."""
    return np.lib.stride_tricks.sliding_window_view(clamped(knots)[1:-1], 3)


def _open_spans(knots: ndarray, s: ndarray) -> tuple[Int[ndarray, " n"], Float[ndarray, "n 8"]]:
    """The knot span of each parameter in an open space, and the four knots round it on either side."""
    whole = clamped(knots)
    span = np.clip(np.searchsorted(whole, s, side="right") - 1, 3, len(whole) - 5)
    return span, whole[span[:, None] + np.arange(-3, 5)]


def _sparse(values: Float[ndarray, "n 4"], functions: Int[ndarray, "n 4"], count: int) -> sp.csr_array:
    """The matrix (n, count) with these values in these columns; those of one place add up."""
    starts = np.arange(0, 4 * len(values) + 1, 4)
    matrix = sp.csr_array((values.ravel(), functions.ravel(), starts), shape=(len(values), count))
    matrix.sum_duplicates()
    return matrix


def curve_knots(s: Float[ndarray, " p"], closed: bool) -> Float[ndarray, " k"]:
    """Knots of the interpolating cubic at parameters s: s itself, or without the second and the last but one
    (not a knot)."""
    return s if closed else s[2:-2]


def interpolate(
    knots: Float[ndarray, " k"], s: Float[ndarray, " p"], points: Float[ndarray, "p d"], closed: bool
) -> Float[ndarray, "p d"]:
    """Control points of the cubic on `knots` through `points` at s."""
    return np.asarray(splu(collocation(knots, s, closed).tocsc()).solve(points))
