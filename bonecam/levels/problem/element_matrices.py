"""Matrices of an open surface over its own Bezier elements, by Gauss points: the thin plate M, int R'R, and
what moves its edges."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.surface.basis.gauss import element_points
from bonecam.surface.query.thin_plate import thin_plate_matrix
from bonecam.surface.tspline import TSpline

GAUSS = 4
"""Gauss points each way on an element: exact to degree seven, the squares of bicubics have six."""
BORDER = 400
"""Points along an edge on which control points are looked for that move it."""
ON_BORDER = 1e-6
"""Control points move an edge where they have a larger share than this of one of its points: rounding has less."""


@dataclass(frozen=True, eq=False)
class ElementMatrices:
    """Gauss samples R with their weights and normals, the thin plate M, N = int R'R, and the control points
    that move an edge."""

    R: sp.csr_array
    weights: Float[ndarray, " n"]
    normals: Float[ndarray, "n 3"]
    M: sp.csc_array
    N: sp.csc_array
    edge: Bool[ndarray, " c"]


def element_matrices(surface: TSpline) -> ElementMatrices:
    """The matrices of a surface."""
    s, t, weights = element_points(surface.elements().boxes, GAUSS)
    R, R_s, R_t = surface.basis(s, t, 1)
    n = np.cross(R_s @ surface.control_points, R_t @ surface.control_points)
    normals = n / np.linalg.norm(n, axis=1, keepdims=True)
    M = thin_plate_matrix(surface, s, t, weights)
    N = sp.csc_array(R.T @ sp.diags_array(weights) @ R)

    # Control points that move an edge of the surface
    ends = surface.domain
    period = surface.elements().period
    reached = np.zeros(surface.tmesh.size)
    for across in (0, 1):
        if period[across]:
            continue
        along = np.linspace(ends[1 - across, 0], ends[1 - across, 1], BORDER)
        for end in ends[across]:
            pair = (np.full(BORDER, end), along) if across == 0 else (along, np.full(BORDER, end))
            reached = np.maximum(reached, surface.basis(*pair)[0].max(axis=0).toarray().ravel())
    return ElementMatrices(R, weights, normals=normals, M=M, N=N, edge=reached > ON_BORDER)
