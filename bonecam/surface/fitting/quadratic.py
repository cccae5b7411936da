"""Quadratic forms of all control points: sum_i (D_i P - X_i)^T M_i (D_i P - X_i), P (n, 3), D a sparse
matrix, M_i (3, 3) symmetric.

Functions of a row-structured T-mesh meet those of the next three rows only: in the order of the control
points the form is a band, and its Cholesky factor costs n times the square of the band's width.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.normal_equations import add_rows, csr_parts


@dataclass(frozen=True, eq=False)
class Term:
    """The terms of `matrix` (m, n) times control points against `targets`, each in its own metric."""

    matrix: sp.csr_array
    metric: Float[ndarray, "m 3 3"]
    targets: Float[ndarray, "m 3"]

    @property
    def width(self) -> int:
        """Largest distance of two columns that meet in a row."""
        starts, columns = self.matrix.indptr, self.matrix.indices
        here = np.diff(starts) > 0
        first = starts[:-1][here]
        return (
            int((np.maximum.reduceat(columns, first) - np.minimum.reduceat(columns, first)).max(initial=0))
            if here.any()
            else 0
        )


@dataclass(frozen=True, eq=False)
class Form:
    """A sum of terms of the control points: half of its matrix as a band, P^T H P - 2 b^T P."""

    band: Float[ndarray, "n3 w"]
    gradient: Float[ndarray, "n 3"]

    @classmethod
    def of(cls, terms: Sequence[Term], size: int) -> "Form":
        """The sum for `size` control points, wide enough for these terms."""
        width = max(term.width for term in terms)
        return cls(np.zeros((3 * size, 3 * width + 3)), np.zeros((size, 3))).plus(terms)

    def plus(self, terms: Sequence[Term]) -> "Form":
        """The form with more terms, whose matrices are no wider than those of the first ones."""
        band, gradient = self.band.copy(), self.gradient.copy()
        for term in terms:
            metric, targets = (np.require(part, requirements=["C", "W"]) for part in (term.metric, term.targets))
            add_rows(band, gradient, *csr_parts(term.matrix), metric, targets)
        return Form(band, gradient)

    def least(self) -> Float[ndarray, "n 3"]:
        """The control points that minimise the form. Raises numpy's LinAlgError where it is not definite."""
        factor = la.cholesky_banded(self.band.T, lower=True, check_finite=True)
        control_points: ndarray = la.cho_solve_banded(
            (factor, True), self.gradient.ravel(), check_finite=False
        ).reshape(-1, 3)
        return control_points
