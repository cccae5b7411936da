"""Quadratic forms of all control points: sum_i (D_i P - X_i)^T M_i (D_i P - X_i), P (n, 3), D a sparse matrix, M_i (3, 3) symmetric."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.normal_equations import add_rows


@dataclass(frozen=True, eq=False)
class Quadratic:
    """P^T H P - 2 b^T P with H (n, 3, n, 3) and b (n, 3), constants left out."""

    hessian: Float[ndarray, "n 3 n 3"]
    gradient: Float[ndarray, "n 3"]

    @classmethod
    def zero(cls, size: int) -> "Quadratic":
        """No terms yet."""
        return cls(np.zeros((size, 3, size, 3)), np.zeros((size, 3)))

    def plus(self, matrix: sp.csr_array, metric: Float[ndarray, "m 3 3"], targets: Float[ndarray, "m 3"]) -> "Quadratic":
        """With the terms of `matrix` (m, n) times control points against `targets`, each in its own metric."""
        hessian = self.hessian.copy()
        rows = sp.csr_array(matrix)
        add_rows(hessian, rows.indptr, rows.indices, rows.data, np.ascontiguousarray(metric))
        return Quadratic(hessian, self.gradient + rows.T @ np.einsum("mab,mb->ma", metric, targets))

    def __add__(self, other: "Quadratic") -> "Quadratic":
        return Quadratic(self.hessian + other.hessian, self.gradient + other.gradient)

    def least(self) -> Float[ndarray, "n 3"]:
        """The control points that make it least. Raises numpy's LinAlgError where the form is not definite."""
        size = len(self.gradient)
        factor = la.cho_factor(self.hessian.reshape(3 * size, 3 * size), overwrite_a=False, check_finite=True)
        found: ndarray = la.cho_solve(factor, self.gradient.ravel()).reshape(size, 3)
        return found
