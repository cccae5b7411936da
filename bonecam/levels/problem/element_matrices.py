"""Matrices of an open surface over its own Bezier elements, by Gauss points: the thin plate M, int R'R, and
what moves its edges."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.surface.tspline import TSpline

GAUSS, BORDER, ON_BORDER = 4, 400, 1e-6


@dataclass(frozen=True, eq=False)
class Fabric:
    """Gauss samples R with their weights and normals, the thin plate M, N = int R'R, and the control points
    that move an edge."""

    R: sp.csr_array
    weights: Float[ndarray, " n"]
    normals: Float[ndarray, "n 3"]
    M: sp.csc_array
    N: sp.csc_array
    edge: Bool[ndarray, " c"]


def fabric_of(surface: TSpline) -> Fabric:
    """The matrices of a surface."""
    boxes = surface.elements().boxes
    x, w = np.polynomial.legendre.leggauss(GAUSS)
    low, size = boxes[:, [0, 2]], boxes[:, [1, 3]] - boxes[:, [0, 2]]
    u, v = (k.ravel() for k in np.meshgrid((x + 1) / 2, (x + 1) / 2))
    s, t = (low[:, i : i + 1] + size[:, i : i + 1] * part for i, part in ((0, u), (1, v)))
    weights = (np.outer(size.prod(1), np.outer(w, w).ravel() / 4)).ravel()
    R, R_s, R_t, ss, st, tt = surface.basis(s.ravel(), t.ravel(), 2)
    W = sp.diags_array(weights)
    M = sp.csc_array(ss.T @ W @ ss + 2 * (st.T @ W @ st) + tt.T @ W @ tt)
    n = np.cross(R_s @ surface.control_points, R_t @ surface.control_points)
    normals = n / np.linalg.norm(n, axis=1, keepdims=True)
    return Fabric(R, weights, normals, M, sp.csc_array(R.T @ W @ R), _on_edge(surface))


def _on_edge(surface: TSpline) -> Bool[ndarray, " c"]:
    """Control points that move an edge of the surface."""
    ends = surface.domain
    period, reached = surface.elements().period, np.zeros(surface.tmesh.size)
    for across in (0, 1):
        if period[across]:
            continue
        along = np.linspace(ends[1 - across, 0], ends[1 - across, 1], BORDER)
        for end in ends[across]:
            pair = (np.full(BORDER, end), along) if across == 0 else (along, np.full(BORDER, end))
            reached = np.maximum(reached, surface.basis(*pair)[0].max(axis=0).toarray().ravel())
    return np.asarray(reached > ON_BORDER)
