"""Bezier extraction of a row-structured T-spline: from knots to elements.

On the t-span k only the rows k-3..k live, so its elements end where one of those four rows has a knot. A seam
that is not a knot is made an element edge as well: no box wraps round.
"""

import numpy as np
from numpy import ndarray

from bonecam.surface.basis.elements import Elements
from bonecam.surface.basis.knots import bernstein_coefficients, distinct


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
