"""Bezier elements of any degree, evaluated by compiled loops."""

from typing import Never

import numpy as np
from jaxtyping import Float, Int32
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.kernels import CONTRACT, inner_njit, njit
from bonecam.surface import Elements


@inner_njit(fastmath=CONTRACT)
def _of_degree(x: float, degree: int, B: ndarray) -> None:
    """Write the Bernstein polynomials of a degree at x into B[: degree + 1]."""
    B[:] = 0.0
    B[0] = 1.0
    for d in range(1, degree + 1):
        for i in range(d, 0, -1):
            B[i] = x * B[i - 1] + (1.0 - x) * B[i]
        B[0] *= 1.0 - x


@inner_njit(fastmath=CONTRACT)
def _bernstein(x: float, h: float, degree: int, B: ndarray) -> None:
    """Write the Bernstein polynomials at x and their first two derivatives into the rows of B (3, degree +
    1).

    `h` is 1 / width of the element.
    """
    lower = np.empty(degree + 1)
    _of_degree(x, degree, B[0])
    B[1:] = 0.0
    for order in (1, 2):
        if order <= degree:
            _of_degree(x, degree - order, lower)
            factor = degree * h if order == 1 else degree * (degree - 1) * h * h
            for i in range(degree + 1 - order):
                B[order, i + order] += factor * lower[i]
                if order == 1:
                    B[1, i] -= factor * lower[i]
                else:
                    B[2, i + 1] -= 2.0 * factor * lower[i]
                    B[2, i] += factor * lower[i]


@njit(cache=True, fastmath=CONTRACT)
def _derivatives(
    patches: ndarray, boxes: ndarray, element: ndarray, s: ndarray, t: ndarray, degree: int, D: ndarray
) -> None:
    """Write S, S_s, S_t, S_ss, S_st, S_tt at each sample into D (1, 3 or 6, n, 3), as many as it holds."""
    a, b = np.empty((3, degree + 1)), np.empty((3, degree + 1))
    A = np.empty((6, 4))
    orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    for n in range(len(s)):
        e = element[n]
        box = boxes[e]
        h, k = 1.0 / (box[1] - box[0]), 1.0 / (box[3] - box[2])
        x, y = (s[n] - box[0]) * h, (t[n] - box[2]) * k
        _bernstein(x, h, degree, a)
        _bernstein(y, k, degree, b)
        A[:] = 0.0
        for m in range(len(D)):
            i, j = orders[m]
            for q in range(degree + 1):
                for p in range(degree + 1):
                    for d in range(4):
                        A[m, d] += a[i, p] * b[j, q] * patches[e, q * (degree + 1) + p, d]
        w = 1.0 / A[0, 3]
        for d in range(3):
            D[0, n, d] = A[0, d] * w
            if len(D) > 1:
                D[1, n, d] = (A[1, d] - A[1, 3] * D[0, n, d]) * w
                D[2, n, d] = (A[2, d] - A[2, 3] * D[0, n, d]) * w
            if len(D) > 3:
                D[3, n, d] = (A[3, d] - 2.0 * A[1, 3] * D[1, n, d] - A[3, 3] * D[0, n, d]) * w
                D[4, n, d] = (A[4, d] - A[1, 3] * D[2, n, d] - A[2, 3] * D[1, n, d] - A[4, 3] * D[0, n, d]) * w
                D[5, n, d] = (A[5, d] - 2.0 * A[2, 3] * D[2, n, d] - A[5, 3] * D[0, n, d]) * w


class ElementsOfDegree(Elements):
    """Elements with (d + 1) x (d + 1) Bernstein coefficients a function, s fastest."""

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
        found = np.empty(((1, 3, 6)[order], len(s), 3))
        s, t = np.ascontiguousarray(s), np.ascontiguousarray(t)
        _derivatives(patches, self.boxes, element=element, s=s, t=t, degree=self.degree, D=found)
        return found

    def basis(self, *_: object) -> Never:
        """Raises SurfaceError: the basis is assembled for cubic elements."""
        raise SurfaceError(f"the elements have degree {self.degree}: the basis is assembled for cubic ones")
