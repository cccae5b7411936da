"""Normal equations of sparse rows with a 3 x 3 metric each: H += D_i^T M_i D_i, row by row."""

import numpy as np
from numba import njit


@njit(cache=True)
def add_rows(hessian: np.ndarray, starts: np.ndarray, columns: np.ndarray, values: np.ndarray, metric: np.ndarray) -> None:
    """Add sum_i v_ij v_ik M_i to hessian[j, :, k, :] (n, 3, n, 3); the rows are CSR, metric (m, 3, 3) symmetric."""
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            for q in range(starts[i], starts[i + 1]):
                k = columns[q]
                product = values[p] * values[q]
                for a in range(3):
                    for b in range(3):
                        hessian[j, a, k, b] += product * metric[i, a, b]
