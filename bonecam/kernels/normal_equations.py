"""Normal equations of sparse rows, compiled: H += D_i^T M_i D_i with a 3 x 3 or 2 x 2 metric for each row,
or H += w_i D_i^T D_i, into a lower band.
"""

from typing import Any

import numpy as np

from bonecam.kernels import njit
from bonecam.kernels.fastmath import CONTRACT


def csr_parts(matrix: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Starts, columns and values of a CSR matrix as the loops here take them: of one kind, for which they are compiled
    once."""
    starts, columns = (part.astype(np.int64, copy=False) for part in (matrix.indptr, matrix.indices))
    return starts, columns, matrix.data


@njit(cache=True)
def add_rows(
    band: np.ndarray,
    gradient: np.ndarray,
    starts: np.ndarray,
    columns: np.ndarray,
    values: np.ndarray,
    metric: np.ndarray,
    targets: np.ndarray,
) -> None:
    """Add v_ij v_ik M_i to the band and v_ij M_i X_i to the gradient (n, 3), for the rows i of a CSR matrix
    v.

    Unknown 3 j + a is axis a of control point j; band[p, q - p] holds H[q, p] for q >= p. metric (m, 3, 3)
    symmetric, targets (m, 3).
    """
    pull = np.zeros(3)
    for i in range(len(starts) - 1):
        for a in range(3):
            pull[a] = (
                metric[i, a, 0] * targets[i, 0] + metric[i, a, 1] * targets[i, 1] + metric[i, a, 2] * targets[i, 2]
            )
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            for a in range(3):
                gradient[j, a] += values[p] * pull[a]
            for q in range(starts[i], starts[i + 1]):
                k = columns[q]
                if k > j:
                    product = values[p] * values[q]
                    for a in range(3):
                        for b in range(3):
                            band[3 * j + a, 3 * (k - j) + b - a] += product * metric[i, a, b]
                elif k == j:
                    product = values[p] * values[q]
                    for a in range(3):
                        for b in range(a, 3):
                            band[3 * j + a, b - a] += product * metric[i, a, b]


@njit(cache=True)
def width(starts: np.ndarray, columns: np.ndarray) -> int:
    """How many diagonals the lower band of the normal equations of a CSR matrix's rows has."""
    most = 0
    for i in range(len(starts) - 1):
        if starts[i] < starts[i + 1]:
            low = high = columns[starts[i]]
            for p in range(starts[i] + 1, starts[i + 1]):
                low, high = min(low, columns[p]), max(high, columns[p])
            most = max(most, high - low)
    return most + 1


@njit(cache=True, fastmath=CONTRACT)
def add_weighted(
    band: np.ndarray, starts: np.ndarray, columns: np.ndarray, values: np.ndarray, weights: np.ndarray
) -> None:
    """Add w_i v_ij v_ik to the band, for the rows i of a CSR matrix v; band[p, q - p] holds H[q, p] for q >=
    p."""
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            share = weights[i] * values[p]
            for q in range(starts[i], p + 1):
                k = columns[q]
                band[min(j, k), abs(j - k)] += share * values[q]


@njit(cache=True, nogil=True, fastmath=CONTRACT)
def add_pairs(
    band: np.ndarray, starts: np.ndarray, columns: np.ndarray, values: np.ndarray, metric: np.ndarray
) -> None:
    """Add v_ij v_ik M_i to the band, for the rows i of a CSR matrix v and symmetric 2 x 2 metrics M (m, 2, 2).

    Unknown 2 j + a is value a of control point j; band[p, q - p] holds H[q, p] for q >= p.
    """
    for i in range(len(starts) - 1):
        first, both, second = metric[i, 0, 0], metric[i, 0, 1], metric[i, 1, 1]
        if first == 0 and second == 0:
            continue
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            for q in range(starts[i], starts[i + 1]):
                apart = 2 * (columns[q] - j)
                if apart < 0:
                    continue
                product = values[p] * values[q]
                band[2 * j, apart] += product * first
                band[2 * j, apart + 1] += product * both
                band[2 * j + 1, apart] += product * second
                if apart:
                    band[2 * j + 1, apart - 1] += product * both
