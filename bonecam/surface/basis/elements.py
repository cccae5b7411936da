"""Bezier elements: the one form in which every T-spline is evaluated (Scott et al. 2011, Bezier extraction).

An element is a box of the parameter domain, the functions that live on it, and for each of them the 16
Bernstein coefficients of its (polynomial) restriction. Nothing downstream needs the T-mesh any more.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int32, Int64
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.errors import SurfaceError
from bonecam.kernels.bezier import any_degree, bicubic, element_search, rational_basis

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
        elements = element_search.locate(*self.strips, s, t)
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
            any_degree.derivatives(patches, self.boxes, element=element, s=s, t=t, degree=self.degree, D=derivatives)
        elif order == 0:
            bicubic.positions(patches, self.boxes, element=element, s=s, t=t, S=derivatives[0])
        elif order == 1:
            bicubic.first_derivatives(patches, self.boxes, element, s, t, *derivatives)
        else:
            bicubic.second_derivatives(patches, self.boxes, element=element, s=s, t=t, D=derivatives)
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
        rational_basis.basis_values(
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
        return bicubic.homogeneous_patches(self.starts, self.functions, self.coefficients, weighted)
