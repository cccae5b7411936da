"""Fairness: the thin-plate energy in lengths, split into a bend (along the normal) and a drift (in the
tangent plane).

With e = |S_s| and g = |S_t| averaged over the row (mm), integrated over the area,

    int |M^(1/2) S_ss|^2 / e^4 + 2 |M^(1/2) S_st|^2 / (e g)^2 + |M^(1/2) S_tt|^2 / g^4,   M = bend n n^T +
    drift (1 - n n^T).

For the drift the second derivatives are taken of the change from the present surface. The bend is the shape's
curvature, so its weight is small; the drift keeps how the parameters run, so its weight may be large without
a cost in deviation. Both grow with the square of the cell a control point has there: where the T-mesh is fine
it is free to turn sharply. Close to a pole e is kept above a part of its mean, as all meridians must turn
there.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.surface.basis.gauss import element_points
from bonecam.surface.fitting.quadratic import Term
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

SHORTEST = 0.35
"""Share of its mean below which e is never taken, so that poles are not held too firmly."""

POLE_WIDTH = 0.25
"""Share of its row in s that a pole's control point is taken to have."""

POINTS = 1
"""Gauss points each way an element: elements are smaller than the cells of the control points."""


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Points (s, t) in every element, the area each stands for, the second derivatives there and the frozen
    lengths."""

    s: Float[ndarray, " n"]
    t: Float[ndarray, " n"]
    places: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    cells: Float[ndarray, " n"]
    blending: sp.csr_array
    parts: tuple[tuple[sp.csr_array, ndarray], ...]

    @classmethod
    def on(cls, surface: TSpline) -> "Quadrature":
        """The quadrature of a surface, with the lengths e and g that it has now."""
        s, t, share = element_points(surface.elements().boxes, POINTS)
        basis = surface.basis(s, t, 2)
        points, Ss, St = (matrix @ surface.control_points for matrix in basis[:3])
        normals = np.cross(Ss, St)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        e, g = (_row_mean(np.linalg.norm(d, axis=1), t, share) for d in (Ss, St))
        e = np.maximum(e, SHORTEST * np.average(e, weights=share))
        cells = (basis[0] @ _shares(surface.tmesh)) * e * g
        parts = ((basis[3], 1 / e**4), (basis[4], 2 / (e * g) ** 2), (basis[5], 1 / g**4))
        return cls(
            s,
            t,
            places=points,
            normals=normals,
            areas=share * e * g,
            cells=cells,
            blending=basis[0],
            parts=parts,
        )

    def terms(self, surface: TSpline, bend: float, drift: float, folded: Bool[ndarray, " n"]) -> list[Term]:
        """The energy with the weights bend and drift, times (mean cell side)^4; where the surface is folded,
        the drift of its own shape."""
        along = np.where(folded[:, None, None], 0.0, self.normals[:, :, None] * self.normals[:, None, :])
        scale = (self.areas * self.cells**2)[:, None, None]
        metric = scale * (drift * np.eye(3) + (bend - drift) * along)
        terms = []
        for matrix, factor in self.parts:
            now = matrix @ surface.control_points
            tangential = now - self.normals * dots(self.normals, now)[:, None]
            tangential[folded] = 0.0
            terms.append(Term(matrix, factor[:, None, None] * metric, tangential))
        return terms

    def held(self, weight: Float[ndarray, " n"]) -> Term:
        """The square of the change of the surface, times weight."""
        return Term(self.blending, (weight * self.areas)[:, None, None] * np.eye(3), self.places)


def _row_mean(lengths: ndarray, t: ndarray, share: ndarray) -> ndarray:
    """The mean of lengths over all points with the same t."""
    _, index = np.unique(t, return_inverse=True)
    return (np.bincount(index, lengths * share) / np.bincount(index, share))[index]


def _shares(tmesh: RowTMesh) -> Float[ndarray, " n"]:
    """The part of the parameter domain each control point has: its support divided by the knot intervals in
    it, in both directions."""
    t = tmesh.t_knots
    tall = (t[4:] - t[:-4]) / sum(
        (t[k + 1 : len(t) - 3 + k] > t[k : len(t) - 4 + k]).astype(float) for k in range(4)
    )
    return np.concatenate([h * _widths(knots) for h, knots in zip(tall, tmesh.s_knots)])


def _widths(knots: ndarray) -> ndarray:
    if len(knots) == 1:
        return np.full(1, POLE_WIDTH)
    unwrapped = np.concatenate([knots[-2:] - 1, knots, knots[:2] + 1])
    return (unwrapped[4:] - unwrapped[:-4]) / 4
