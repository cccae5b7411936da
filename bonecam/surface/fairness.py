"""Fairness: the thin-plate energy in lengths, split into a bend (along the normal) and a drift (in the tangent plane).

With e = |S_s| and g = |S_t| averaged over the row (mm), integrated over the area,

    int |M^(1/2) S_ss|^2 / e^4 + 2 |M^(1/2) S_st|^2 / (e g)^2 + |M^(1/2) S_tt|^2 / g^4,   M = bend n n^T + drift (1 - n n^T).

For the drift the second derivatives are taken of the change from the present surface. The bend is the shape's curvature, so its weight is
small; the drift keeps how the parameters run, so its weight may be large without a cost in deviation. Close to a pole e is kept above a
part of its mean, as all meridians must turn there.
"""

import numpy as np

from bonecam.surface.quadratic import Quadratic
from bonecam.surface.tspline import TSpline

AROUND = 40  # quadrature points round each row
SHORTEST = 0.35  # e is never taken below this part of its mean: the poles
GAUSS = np.array([-1.0, 1.0]) / np.sqrt(12) + 0.5


def fairness(surface: TSpline, bend: float, drift: float) -> Quadratic:
    """The energy as a quadratic form of the control points, lengths and normals frozen at `surface`. Weights in mm^4."""
    knots = np.unique(surface.tmesh.t_knots)
    t = (knots[:-1, None] + np.diff(knots)[:, None] * GAUSS).ravel()
    width = np.repeat(np.diff(knots) / len(GAUSS), len(GAUSS))
    shape = (len(t), AROUND)
    s_all, t_all = np.tile(np.arange(AROUND) / AROUND, len(t)), np.repeat(t, AROUND)
    basis = surface.basis(s_all, t_all, 2)
    Ss, St = basis[1] @ surface.control_points, basis[2] @ surface.control_points
    normals = np.cross(Ss, St)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    e, g = (np.linalg.norm(v, axis=1).reshape(shape).mean(axis=1) for v in (Ss, St))
    e = np.maximum(e, SHORTEST * e.mean())
    area = np.repeat(e * g * width / AROUND, AROUND)
    e, g = np.repeat(e, AROUND), np.repeat(g, AROUND)
    along = normals[:, :, None] * normals[:, None, :]
    metric = drift * np.eye(3) + (bend - drift) * along
    form = Quadratic.zero(surface.tmesh.size)
    for matrix, factor in ((basis[3], 1 / e**4), (basis[4], 2 / (e * g) ** 2), (basis[5], 1 / g**4)):
        now = matrix @ surface.control_points
        tangential = now - normals * np.einsum("ij,ij->i", normals, now)[:, None]
        form = form.plus(matrix, (area * factor)[:, None, None] * metric, tangential)
    return form
