"""The T-mesh in index and knot space: which control points there are and which knots each sees.

Row-structured T-meshes (what skinning makes, Yang & Zheng 2012): S(s, t) = sum_j N_j(t) Q_j(s), one clamped
t-knot vector for all rows and a periodic s-knot vector for every row. A row with one control point is a pole:
its s-function is the constant 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.surface.basis.elements import Elements
from bonecam.surface.basis.knots import fault, span_functions
from bonecam.surface.basis.row_extraction import extract_rows

NEAREST = 1e-12
"""Share of the range: knots that differ by less differ by rounding only."""

LARGEST = 1e18
"""Knots and the inverse of their steps must be smaller, lest derivatives overflow."""


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
