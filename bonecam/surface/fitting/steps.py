"""One step of the fit: all control points at once, and no fold.

With the feet (s, t) and normals n of the surface before, a step solves

    min sum_i w_i [ (n_i . (S(s_i, t_i) - X_i))^2 + slide |S(s_i, t_i) - X_i|^2 ] + fairness + poles,

the tangent-distance step (Wang, Pottmann & Liu 2006): samples may slide in the tangent plane at little cost, so the
parameters follow the shape and steps converge in few rounds. w_i grows with the miss, which trades a little of the rms
for the maximum. The row next to a pole is kept in one plane with it and roughly round it: where it lies near the rim
of its row a surface folds. Where the solved surface would fold, the change is held back round that place only.

Fairness: the thin-plate energy in lengths, split into a bend (along the normal) and a drift (in the
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
from scipy.spatial import cKDTree

from bonecam.arrays import dots
from bonecam.surface.basis.gauss import element_points
from bonecam.surface.fitting.quadratic import Form, Term
from bonecam.surface.fitting.target import FitTarget
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
            s, t, places=points, normals=normals, areas=share * e * g, cells=cells, blending=basis[0], parts=parts
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
    tall = (t[4:] - t[:-4]) / sum((t[k + 1 : len(t) - 3 + k] > t[k : len(t) - 4 + k]).astype(float) for k in range(4))
    return np.concatenate([h * _widths(knots) for h, knots in zip(tall, tmesh.s_knots)])


def _widths(knots: ndarray) -> ndarray:
    if len(knots) == 1:
        return np.full(1, POLE_WIDTH)
    unwrapped = np.concatenate([knots[-2:] - 1, knots, knots[:2] + 1])
    return (unwrapped[4:] - unwrapped[:-4]) / 4


SLIDE = 0.1
"""Weight of a sample's distance in the tangent plane, against 1 along the normal."""

BEND = 2e-5
"""Weight of the fairness along the normal, times (mean cell side)^4."""

DRIFT = 3e-2
"""Weight of the fairness in the tangent plane, times (mean cell side)^4."""

NEAR = 2.0
"""Tolerances: from the largest distance that is smaller on, samples are weighted by their distance sharply."""

FAR_STRESS, NEAR_STRESS = (0.4, 2), (0.5, 4)
"""Weight of a sample that is met, and power of the distance in the weight; before and from NEAR on."""

DAMPING = 1e-4
"""Weight of the change itself, against that of the samples."""

FIRMER = 30.0
"""Factor on the damping round a fold, at each try; the damping is then 1 at least."""

TRIES = 3
"""Tries with firmer damping, and then with control points that stay."""

RING = 0.3
"""Weight of the ellipses round the poles, times the mean area of a control point."""

OFF = 0.3
"""Share of a ring's size that it may be off its ellipse."""

FINAL_PLANE_WEIGHT = 1000.0
"""Weight of the planes through the poles in the last steps, times the mean area of a control point."""

REACH = 2.0
"""Mean cell sides round a fold within which the change is damped."""

LEAST_TURN = 0.5
"""Cosine: a normal that turned further than this in one step may be a fold."""

WELL = 0.7
"""Cosine with the mesh's normal from which on a normal that turned is no fold."""

LEAST_FACING = 0.2
"""Cosine with the mesh's normal below which a normal is folded."""

LOSS = 0.02
"""Smaller losses of that cosine in one step are not counted as folds."""


def step(surface: TSpline, target: FitTarget, tolerance: float, plane: float, off: float) -> TSpline:
    """The surface after one step of the fit.

    Where it would fold, the change is damped round the fold; where it folds still, control points there
    stay. `plane` weighs the planes through the poles, `off` is the share of a ring's size that it may be
    off its ellipse.
    """
    quadrature = Quadrature.on(surface)
    share = target.inward.areas.sum() / surface.tmesh.size
    data = (
        data_terms(surface, target, tolerance, SLIDE)
        + pole_planes(surface, plane * share)
        + pole_rings(surface, RING * share, off)
    )
    damping = np.full(len(quadrature.s), DAMPING)
    stepped = surface
    grid = fold_grid(surface)
    before = surface.normals(*grid), target.shape.facing(surface, *grid)
    folded = _round(surface, quadrature, grid, before[1] < LEAST_FACING)
    form = Form.of([*data, *quadrature.terms(surface, BEND, DRIFT, folded)], surface.tmesh.size)
    for _ in range(TRIES):
        stepped = surface.with_control_points(form.plus([quadrature.held(damping)]).least())
        folded = folds(stepped, target, grid, before)
        if not folded.any():
            return stepped
        damping = np.where(_round(surface, quadrature, grid, folded), np.maximum(FIRMER * damping, 1.0), damping)
    (basis,) = surface.basis(*grid)
    moving = np.ones(surface.tmesh.size, dtype=bool)
    for _ in range(TRIES):
        moving[basis[np.flatnonzero(folded)].indices] = False
        points = np.where(moving[:, None], stepped.control_points, surface.control_points)
        stepped = surface.with_control_points(points)
        folded = folds(stepped, target, grid, before)
        if not folded.any():
            return stepped
    return surface


def fair_step(
    surface: TSpline, target: FitTarget, tolerance: float, sharp: Bool[ndarray, " n"], weight: float
) -> TSpline:
    """The surface after a step in which its shape, not only its change, resists the thin-plate energy with this weight
    round the `sharp` points of its `Quadrature`; poles stay round. A fold is not looked for."""
    share = target.inward.areas.sum() / surface.tmesh.size
    quadrature = Quadrature.on(surface)
    near = _round(surface, quadrature, (quadrature.s, quadrature.t), sharp)
    terms = [
        *data_terms(surface, target, tolerance, SLIDE),
        *pole_planes(surface, FINAL_PLANE_WEIGHT * share),
        *pole_rings(surface, RING * share, 0.0),
        *quadrature.terms(surface, BEND, weight, near),
        quadrature.held(np.full(len(quadrature.s), DAMPING)),
    ]
    return surface.with_control_points(Form.of(terms, surface.tmesh.size).least())


def _round(surface: TSpline, quadrature: Quadrature, grid: tuple[ndarray, ndarray], which: ndarray) -> ndarray:
    """The quadrature points near to some of the grid."""
    if not which.any():
        return np.zeros(len(quadrature.s), dtype=bool)
    near, _ = cKDTree(surface.positions(grid[0][which], grid[1][which])).query(quadrature.places)
    return near < REACH * np.sqrt(quadrature.cells)


def fold_grid(surface: TSpline) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """s and t of the middle of each element and of a grid that crowds at the poles."""
    boxes = surface.elements().boxes
    near = 0.5 ** np.arange(1, 9) * boxes[:, 3].min()
    s, t = np.meshgrid(np.arange(48) / 48, np.concatenate([near, 1 - near]))
    inner_s, inner_t, _ = element_points(surface.elements().boxes, 2)
    return np.concatenate([s.ravel(), inner_s]), np.concatenate([t.ravel(), inner_t])


def folds(
    surface: TSpline, target: FitTarget, grid: tuple[ndarray, ndarray], before: tuple[ndarray, ndarray]
) -> ndarray:
    """Where a normal turned too far from what it was before, or away from the mesh's."""
    turn = dots(surface.normals(*grid), before[0])
    facing = target.shape.facing(surface, *grid)
    turned = (turn < LEAST_TURN) & (facing < np.minimum(before[1], WELL))
    return turned | ((facing < LEAST_FACING) & (facing < before[1] - LOSS))


def data_terms(surface: TSpline, target: FitTarget, tolerance: float, slide: float) -> list[Term]:
    """The samples against their feet, normals and lengths of now."""
    samples = target.all
    (basis,) = surface.basis(samples.s, samples.t)
    normals = surface.normals(samples.s, samples.t)
    least, power = NEAR_STRESS if target.worst < NEAR * tolerance else FAR_STRESS
    met = np.append(
        np.full(len(target.inward.areas), least), np.zeros(len(target.outward.areas))
    )  # the latter come and go unnoticed
    weights = samples.areas * (met + (samples.distances / max(tolerance, target.worst / NEAR)) ** power)
    metric = weights[:, None, None] * (slide * np.eye(3) + (1 - slide) * normals[:, :, None] * normals[:, None, :])
    return [Term(basis, metric, samples.points)]


@dataclass(frozen=True, eq=False)
class Ring:
    """A pole, the control points next to it, `arms` that yield their offsets from it, the unit area vector of
    the polygon they make."""

    points: ndarray
    arms: sp.csr_array
    normal: Float[ndarray, "3"]
    knots: Float[ndarray, " r"]


def rings(surface: TSpline) -> list[Ring]:
    """The rings of control points round the lower and the upper pole."""
    starts = surface.tmesh.row_starts
    size = surface.tmesh.size
    knots = surface.tmesh.s_knots
    by_pole = []
    for pole, row in ((0, 1), (size - 1, len(knots) - 2)):
        points = np.arange(starts[row], starts[row + 1])
        pairs = np.sort(np.column_stack([points, np.full(len(points), pole)]), axis=1)
        signs = np.where(pairs == pole, -1.0, 1.0)
        arms = sp.csr_array(
            (signs.ravel(), pairs.ravel(), np.arange(0, 2 * len(points) + 1, 2)), shape=(len(points), size)
        )
        offsets = arms @ surface.control_points
        normal = np.cross(offsets, np.roll(offsets, -1, axis=0)).sum(axis=0)
        by_pole.append(Ring(points, arms, normal / np.linalg.norm(normal), knots[row]))
    return by_pole


def flatten_poles(surface: TSpline) -> TSpline:
    """The surface with the control points next to each pole moved square into the plane that `pole_planes`
    draws them to.
    """
    points = surface.control_points.copy()
    for ring in rings(surface):
        points[ring.points] -= ((ring.arms @ points) @ ring.normal)[:, None] * ring.normal
    return surface.with_control_points(points)


def pole_planes(surface: TSpline, weight: float) -> list[Term]:
    """Keeps the control points next to each pole in one plane with it, square to the area vector of their
    polygon now."""
    terms = []
    for ring in rings(surface):
        metric = np.broadcast_to(weight * np.outer(ring.normal, ring.normal), (len(ring.points), 3, 3))
        terms.append(Term(ring.arms, metric, np.zeros((len(ring.points), 3))))
    return terms


def pole_rings(surface: TSpline, weight: float, free: float) -> list[Term]:
    """Draws the control points next to each pole towards an ellipse round it, at the angles of their knots,
    where they are far off it.

    Such a ring is a polar patch smooth at its pole; within `free` of its size it is free, as no bone's end is
    an ellipsoid's.
    """
    terms = []
    for ring in rings(surface):
        ellipse = np.column_stack([np.cos(2 * np.pi * ring.knots), np.sin(2 * np.pi * ring.knots)])
        off = np.eye(len(ellipse)) - ellipse @ np.linalg.pinv(ellipse)
        arms = ring.arms @ surface.control_points
        now = off @ arms
        within = free * np.sqrt((arms**2).sum(axis=1).mean())
        far = np.linalg.norm(now, axis=1)
        nearer = now * np.minimum(1.0, within / np.maximum(far, np.finfo(float).tiny))[:, None]
        terms.append(Term(sp.csr_array(off @ ring.arms), (weight * (far > within))[:, None, None] * np.eye(3), nearer))
    return terms
