"""Bezier extraction of a row-structured T-spline: from knots to elements.

On the t-span k only the rows k-3..k live, so its elements end where one of those four rows has a knot. A seam that
is not a knot is made an element edge as well: no box wraps round.
"""

import numpy as np
from numpy import ndarray

from bonecam.surface.elements import Elements
from bonecam.surface.knots import bernstein_coefficients, distinct


def extract_rows(t_knots: ndarray, s_knots: tuple[ndarray, ...]) -> Elements:
    """The elements of S(s, t) = sum_j N_j(t) Q_j(s), row j periodic over [0, 1) with knots s_knots[j]."""
    row_starts = np.concatenate([[0], np.cumsum([len(row) for row in s_knots])])
    spans = np.flatnonzero(np.diff(t_knots) > 0)
    spans = spans[(spans >= 3) & (spans < len(t_knots) - 4)]
    strips = [_strip(int(k), t_knots, s_knots, row_starts) for k in spans]
    boxes, counts, functions, coefficients = (np.concatenate(parts) for parts in zip(*strips))
    return Elements(boxes, np.concatenate([[0], np.cumsum(counts)]), functions, coefficients, period=(1.0, 0.0))


def _strip(k: int, t_knots: ndarray, s_knots: tuple[ndarray, ...], row_starts: ndarray) -> tuple[ndarray, ...]:
    """Boxes, function counts, function ids and coefficients of the elements on t-span k."""
    rows = range(k - 3, k + 1)
    breaks = distinct(np.concatenate([[0.0, 1.0]] + [s_knots[j] for j in rows if len(s_knots[j]) > 1]))
    low, high = breaks[:-1], breaks[1:]
    along = bernstein_coefficients(t_knots[None, k - 3 : k + 5], t_knots[[k]], t_knots[[k + 1]])[0]
    ids, values = [], []
    for j in rows:
        around, index = _row(s_knots[j], low, high)
        values.append((along[j - k + 3][None, None, :, None] * around[:, :, None, :]).reshape(len(low), -1, 16))
        ids.append(row_starts[j] + index)
    functions, coefficients = np.concatenate(ids, axis=1), np.concatenate(values, axis=1)
    order = np.argsort(functions, axis=1)
    functions = np.take_along_axis(functions, order, axis=1)
    coefficients = np.take_along_axis(coefficients, order[:, :, None], axis=1)
    boxes = np.column_stack([low, high, np.full_like(low, t_knots[k]), np.full_like(low, t_knots[k + 1])])
    return boxes, np.full(len(low), functions.shape[1]), functions.ravel(), coefficients.reshape(-1, 16)


def _row(knots: ndarray, low: ndarray, high: ndarray) -> tuple[ndarray, ndarray]:
    """Coefficients (n, f, 4) of one row's functions on each [low, high], and which they are (n, f)."""
    count = len(knots)
    if count == 1:
        return np.ones((len(low), 1, 4)), np.zeros((len(low), 1), dtype=np.int64)
    span = np.searchsorted(knots, (low + high) / 2, side="right") - 1
    window = span[:, None] + np.arange(-3, 5)
    unwrapped = knots[window % count] + window // count
    return bernstein_coefficients(unwrapped, low, high), (span[:, None] + np.arange(-1, 3)) % count
