"""T-meshes: which control points there are, which knots each sees, and the Bezier elements of the surface over them.

Two kinds of rows:

    RowTMesh        rows that are closed, S(s, t) = sum_j N_j(t) Q_j(s): one clamped t-knot vector for all rows and a
                    periodic s-knot vector for every row; a row with one control point is a pole: its s-function is the
                    constant 1 (what fits and skinning make, Yang & Zheng 2012)
    OpenRowTMesh    rows that are open, both directions clamped; the sum over a row is one, so the weights may be left
                    at one

Plugins add others. A T-mesh has a `size`, its number of control points; `poles`, whether the lower and the upper end of
t is one control point; and `elements`, the Bezier elements. A kind may have two methods beside that:
`refine(surface, s, t, directions)` makes the unchanged surface with the faces cut that hold samples, and
`tessellate(surface, chord_tolerance, angle_tolerance, most_vertices)` its Tessellation; without them it is refined and
tessellated as rows are.

Bezier extraction (Scott et al. 2011): only the rows k-3..k live on the t-span k, so its elements end where one of those
four rows has a knot.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias, TypeVar

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

import bonecam
from bonecam.arrays import frozen
from bonecam.surface.basis import (
    Elements,
    bernstein_coefficients,
    clamped_spans,
    distinct,
    fault,
    functions_at,
    span_functions,
    spans,
)

Surface: TypeAlias = "bonecam.surface.TSpline"
"""The surface over a T-mesh, as the rooms name it that compute with one and come before its class, which calls them."""

NEAREST = 1e-12
"""Share of the range: knots of rows that differ by less differ by rounding only."""

LARGEST = 1e18
"""Knots and the inverse of their range must be smaller, lest derivatives overflow."""


@dataclass(frozen=True, eq=False)
class OpenRowTMesh:
    """Rows j = 0..m-1 over t_knots (m+4,), row j with s_knots[j] (its control points + 4), 0 and 1 four times
    at the ends."""

    t_knots: Float[ndarray, " k"]
    s_knots: tuple[Float[ndarray, " _"], ...]

    poles = (False, False)
    """No end of t is one point."""

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
            if fault(row) or not _clamped(row) or row[0] != 0 or row[-1] != 1:
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
        return int(self.row_starts[-1])

    @cached_property
    def elements(self) -> Elements:
        """The Bezier elements: on a t-span they end where one of its four rows has a knot."""
        return _extract_rows(self)


def _clamped(knots: ndarray) -> bool:
    """Whether increasing knots end in fourfold knots and have no other knot more than three times."""
    return bool(
        len(knots) >= 8
        and (knots[:4] == knots[0]).all()
        and (knots[-4:] == knots[-1]).all()
        and (knots[4:] > knots[:-4]).all()
    )


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
        return int(self.row_starts[-1])

    @property
    def poles(self) -> tuple[bool, bool]:
        """Whether the lower and the upper end of t is one point."""
        return len(self.s_knots[0]) == 1, len(self.s_knots[-1]) == 1

    @cached_property
    def elements(self) -> Elements:
        """The Bezier elements."""
        return _extract_rows(self)

    def blending(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> sp.csr_array:
        """The blending functions at (s, t), by the recurrence: sparse (n, size)."""
        span, window = clamped_spans(self.t_knots, t)
        along = span_functions(window, t, 0)[0]
        rows: list[ndarray] = []
        columns: list[ndarray] = []
        values: list[ndarray] = []
        for j, (start, knots) in enumerate(zip(self.row_starts, self.s_knots)):
            here = np.flatnonzero((span - 3 <= j) & (j <= span))
            around, index = np.ones((len(here), 1)), np.zeros((len(here), 1), dtype=np.int64)
            if len(knots) > 1:
                around, index = functions_at(knots, s[here])
            rows.append(np.repeat(here, index.shape[1]))
            columns.append((start + index).ravel())
            values.append((around * along[here, j - span[here] + 3][:, None]).ravel())
        where = (np.concatenate(rows), np.concatenate(columns))
        return sp.csr_array((np.concatenate(values), where), shape=(len(s), self.size))


def _extract_rows(tmesh: RowTMesh | OpenRowTMesh) -> Elements:
    """The elements of S(s, t) = sum_j N_j(t) Q_j(s). The seam of closed rows is an element edge, too: no box wraps
    round."""
    closed = isinstance(tmesh, RowTMesh)
    t_knots, s_knots, row_starts = tmesh.t_knots, tmesh.s_knots, tmesh.row_starts
    t_spans = np.flatnonzero(np.diff(t_knots) > 0)
    t_spans = t_spans[(t_spans >= 3) & (t_spans < len(t_knots) - 4)]
    along = bernstein_coefficients(t_knots[t_spans[:, None] + np.arange(-3, 5)], t_knots[t_spans], t_knots[t_spans + 1])

    # Of each row on each t-span the eight knots round its elements, where these begin and end, and their functions;
    # of a pole no knots
    strips = []
    rows = []
    for k in t_spans:
        four = s_knots[k - 3 : k + 1]
        breaks = distinct(np.concatenate([[0.0, 1.0], *(row for row in four if len(row) > 1)]))
        breaks[-1] = 1.0  # a knot that differs from it by rounding is the seam
        low, high = breaks[:-1], breaks[1:]
        strips.append((low, high))
        for knots in four:
            if len(knots) == 1:
                rows.append((np.empty((0, 8)), low[:0], high[:0], np.zeros((len(low), 1), dtype=np.int64)))
                continue
            span, window = (spans if closed else clamped_spans)(knots, (low + high) / 2)
            functions = (span[:, None] + np.arange(-1, 3)) % len(knots) if closed else span[:, None] + np.arange(-3, 1)
            rows.append((window, low, high, functions))
    around = bernstein_coefficients(*(np.concatenate([row[part] for row in rows]) for part in range(3)))
    around_rows = np.split(around, np.cumsum([len(row[0]) for row in rows])[:-1])

    parts = []
    for n, (k, (low, high)) in enumerate(zip(t_spans, strips)):
        values = []
        ids = []
        for i in range(4):
            s = around_rows[4 * n + i] if len(s_knots[k - 3 + i]) > 1 else np.ones((len(low), 1, 4))
            values.append((along[n, i][None, None, :, None] * s[:, :, None, :]).reshape(len(low), -1, 16))
            ids.append(row_starts[k - 3 + i] + rows[4 * n + i][3])
        functions = np.concatenate(ids, axis=1)
        order = np.argsort(functions, axis=1)
        coefficients = np.take_along_axis(np.concatenate(values, axis=1), order[:, :, None], axis=1)
        boxes = np.column_stack([low, high, np.full_like(low, t_knots[k]), np.full_like(low, t_knots[k + 1])])
        counts = np.full(len(low), functions.shape[1])
        parts.append(
            (boxes, counts, np.take_along_axis(functions, order, axis=1).ravel(), coefficients.reshape(-1, 16))
        )
    boxes, counts, functions, coefficients = (np.concatenate(part) for part in zip(*parts))
    starts = np.concatenate([[0], np.cumsum(counts)])
    return Elements(boxes, starts, functions, coefficients, period=(float(closed), 0.0))


M = TypeVar("M", bound=Any)
"""A kind of T-mesh."""
