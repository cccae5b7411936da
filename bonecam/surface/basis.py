"""Cubic B-spline functions in one parameter, Gauss-Legendre quadrature on knot spans and elements, and Bezier elements.

Functions come from the recurrence of Cox and de Boor, many spans at once. Splines in one parameter on [0, 1] have
collocation, interpolation and knot insertion; a space is told by its `knots`: closed, the distinct periodic knots in
[0, 1), as many control points (control point i belongs to the function that is centred on knot i); open, the knots
inside (0, 1) without the fourfold ends, four control points more. Matrices are sparse: four functions live at a
parameter.

Bezier elements are the one form in which every T-spline is evaluated (Scott et al. 2011). An element is a box of the
parameter domain, the functions that live on it, and for each of them the 16 Bernstein coefficients of its (polynomial)
restriction. Nothing downstream needs the T-mesh any more.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int, Int32, Int64
from numpy import ndarray
from scipy.sparse.linalg import splu

from bonecam.arrays import frozen
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
    high, high), (high, high, high).
    """
    corners = ((low, low, low), (low, low, high), (low, high, high), (high, high, high))
    result = np.empty((len(knots), 4, 4))
    for i, corner in enumerate(corners):
        result[:, :, i] = _blossoms(knots, np.column_stack(corner))
    return result


def _blossoms(knots: Float[ndarray, "n 8"], arguments: Float[ndarray, "n 3"]) -> Float[ndarray, "n 4"]:
    """The blossoms at three arguments of the four cubics that live on the span [knots[:, 3], knots[:, 4]] (Ramshaw
    1989), by de Boor's triangle on the four unit coefficient vectors."""
    points = np.broadcast_to(np.eye(4), (len(knots), 4, 4))  # [n, de Boor point, function]
    for r in (1, 2, 3):
        left, right = knots[:, r:4], knots[:, 4 : 8 - r]
        ratio = ((arguments[:, r - 1, None] - left) / (right - left))[:, :, None]
        points = points[:, :-1] * (1 - ratio) + points[:, 1:] * ratio
    return points[:, 0]


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
    """The last of the periodic knots at or below each parameter in [0, 1), and the four knots round it on either side,
    unwrapped."""
    span = np.searchsorted(knots, s, side="right") - 1
    window = span[:, None] + np.arange(-3, 5)
    return span, knots[window % len(knots)] + window // len(knots)


def clamped_spans(
    knots: Float[ndarray, " k"], x: Float[ndarray, " n"]
) -> tuple[Int[ndarray, " n"], Float[ndarray, "n 8"]]:
    """The span of clamped knots that holds each parameter (the last one holds the end too), and the four knots round it
    on either side."""
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, 3, len(knots) - 5)
    return span, knots[span[:, None] + np.arange(-3, 5)]


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

    coefficients[k] belongs to functions[k]: 4 x 4 Bernstein coefficients, s fastest. `period` is the length of a
    closed direction (s, t), 0 where it is open. Functions are increasing within an element.
    """

    boxes: Float[ndarray, "e 4"]
    starts: Int64[ndarray, " e1"]
    functions: Int64[ndarray, " k"]
    coefficients: Float[ndarray, "k c"]
    period: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("boxes", "starts", "functions", "coefficients"):
            whole = name in ("starts", "functions")
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64 if whole else np.float64))

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
        slices = np.linspace(knots[0], knots[-1], SLICES, endpoint=False) - 1e-9 * np.ptp(knots)
        table = np.clip(np.searchsorted(knots, slices, side="right") - 1, 0, None).astype(np.int32)
        tables = np.empty((len(members), SLOTS), dtype=np.int32)
        for k, (a, b) in enumerate(pairwise(starts)):
            slots = np.linspace(lows[a], highs[b - 1], SLOTS, endpoint=False) - 1e-9 * (highs[b - 1] - lows[a])
            tables[k] = a + np.clip(np.searchsorted(lows[a:b], slots, side="right") - 1, 0, None)
        return knots, table, starts, lows, highs, ids, tables

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
        if order == 0:
            bezier.positions(patches, self.boxes, element=element, s=s, t=t, S=derivatives[0])
        elif order == 1:
            bezier.first_derivatives(patches, self.boxes, element, s, t, *derivatives)
        else:
            bezier.second_derivatives(patches, self.boxes, element=element, s=s, t=t, D=derivatives)
        return derivatives

    def basis(
        self, weights: Float[ndarray, " m"], s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int
    ) -> tuple[sp.csr_array, ...]:
        """The rational basis R; R_s, R_t (order 1); R_ss, R_st, R_tt (order 2): sparse (n, m)."""
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
    span, window = clamped_spans(clamped(knots), s)
    return _sparse(span_functions(window, s, 0)[0], span[:, None] + np.arange(-3, 1), len(knots) + 4)


def insertion(knots: Float[ndarray, " k"], fine: Float[ndarray, " f"], closed: bool) -> sp.csr_array:
    """The control points on `fine`, which holds all the knots, of a curve on `knots`: (n, c).

    Control point i is the curve's blossom at the three inner knots of function i.
    """
    at = sites(fine, closed)
    if closed:
        span, window = spans(knots, at)
        functions = (span[:, None] + np.arange(-1, 3)) % len(knots)
        arguments = np.column_stack([np.roll(fine, 1), fine, np.roll(fine, -1)])
        arguments[0, 0] -= 1
        arguments[-1, 2] += 1
    else:
        span, window = clamped_spans(clamped(knots), at)
        functions = span[:, None] + np.arange(-3, 1)
        arguments = _open_arguments(fine)
    return _sparse(_blossoms(window, arguments), functions, len(knots) + 4 * (not closed))


def _open_arguments(knots: ndarray) -> Float[ndarray, "n 3"]:
    """The three inner knots of each function of an open space."""
    return np.lib.stride_tricks.sliding_window_view(clamped(knots)[1:-1], 3)


def _sparse(values: Float[ndarray, "n 4"], functions: Int[ndarray, "n 4"], count: int) -> sp.csr_array:
    """The matrix (n, count) with these values in these columns; those of one place add up."""
    starts = np.arange(0, 4 * len(values) + 1, 4)
    matrix = sp.csr_array((values.ravel(), functions.ravel(), starts), shape=(len(values), count))
    matrix.sum_duplicates()
    return matrix


def interpolate(
    knots: Float[ndarray, " k"], s: Float[ndarray, " p"], points: Float[ndarray, "p d"], closed: bool
) -> Float[ndarray, "p d"]:
    """Control points of the cubic on `knots` through `points` at s."""
    return np.asarray(splu(collocation(knots, s, closed).tocsc()).solve(points))
