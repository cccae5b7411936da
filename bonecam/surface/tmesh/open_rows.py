"""Row-structured T-meshes with open rows: S(s, t) = sum_j N_j(t) Q_j(s), both directions clamped, every row
with its own s-knots.

What skinning makes of open sections (Yang & Zheng 2012). The sum over a row is one, so the weights may be
left at one.
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
from bonecam.surface.basis.knots import bernstein_coefficients, distinct, fault, span_functions

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
