"""Fitting a T-spline to a mesh.

Samples of a mesh: its vertices and points inside its faces, each with the area it stands for.

Quadratic forms of all control points: sum_i (D_i P - X_i)^T M_i (D_i P - X_i), P (n, 3), D a sparse
matrix, M_i (3, 3) symmetric.

Functions of a row-structured T-mesh meet those of the next three rows only: in the order of the control
points the form is a band, and its Cholesky factor costs n times the square of the band's width.

The samples of a mesh that a surface is fitted to, and the parameters of the closest surface points.

The first parameters come from the mesh itself, the harmonic height and the share round the row
(`Rows.vertex_parameters`): they are right in a groove too, where the closest point of a smooth surface lies
on the wrong side. Later closest points are followed from where they were. Beside a rim one may stay on the
wrong side, so the last samples that seem missed are also sought from the parameters of other samples.

How far surface and mesh are from each other, both ways, on dense samples: the symmetric Hausdorff distance
as measured, and the rms.

A surface on a T-mesh before any step of the fit: the first one through the rows' loops, and one like the surface
on another T-mesh.

One step of the fit: all control points at once, and no fold.

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

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import dots
from bonecam.kernels.matrices import add_rows, csr_parts
from bonecam.mesh.distance import MeshDistance, barycentric, exact_closest, hausdorff
from bonecam.mesh.rows import Rows
from bonecam.mesh.solids import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.basis import FEWEST, element_points
from bonecam.surface.query import follow_closest_points, grid_parameters, nearest_on_grid
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline


def sample_mesh(mesh: TriangleMesh, count: int) -> tuple[Float[ndarray, "n 3"], Float[ndarray, " n"]]:
    """All vertices and about `count` points inside the faces, evenly by area; and areas (mm^2) that add up to
    the mesh's area.

    A face gets k^2 points, the centres of its k^2 similar parts, where k^2 is its share rounded up.
    Deterministic.
    """
    areas = np.linalg.norm(mesh.face_vectors, axis=1) / 2
    parts = np.ceil(np.sqrt(count * areas / areas.sum()) - 0.2).clip(1).astype(np.int64)
    points = [mesh.vertices]
    weights = [np.bincount(mesh.faces.ravel(), np.repeat(areas / 3, 3), minlength=len(mesh.vertices)) / 4]
    for k in np.unique(parts).tolist():
        chosen = parts == k
        corners = mesh.vertices[mesh.faces[chosen]]
        # Barycentric centres of the k^2 similar parts of a triangle.
        i, j = (v.ravel() for v in np.meshgrid(np.arange(k), np.arange(k)))
        up = i + j < k
        down = i + j < k - 1
        first = np.column_stack([i[up] + 1 / 3, j[up] + 1 / 3])
        second = np.column_stack([i[down] + 2 / 3, j[down] + 2 / 3])
        two = np.vstack([first, second]) / k
        inside = np.einsum("qc,fcd->fqd", np.column_stack([two, 1 - two.sum(axis=1)]), corners).reshape(-1, 3)
        points.append(inside)
        weights.append(np.repeat(0.75 * areas[chosen] / k**2, k**2))
    return np.vstack(points), np.concatenate(weights)


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
        first = starts[:-1][np.diff(starts) > 0]
        if not len(first):
            return 0
        return int((np.maximum.reduceat(columns, first) - np.minimum.reduceat(columns, first)).max())


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


FOLD_CHORD = 3e-4
"""Share of the diagonal: chord tolerance of the tessellation that is checked against itself."""

OUTWARD = 2
"""Gauss points each way an element that are measured to the mesh."""

PULLED = 2.0
"""Tolerances: surface points farther than this from the mesh are drawn to it."""

WATCHED = 0.5
"""Tolerances: surface points at places that a dense measurement missed are drawn to the mesh from here on."""

DOUBTFUL = 100
"""One in so many samples, at most, is looked for elsewhere on the surface."""

EACH = 8
"""Samples of the mesh, at least, for each control point."""


class MeshNormals:
    """The mesh, asked for the normal nearest to a point."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self.distance = MeshDistance(mesh)
        self._normals = mesh.face_vectors / np.maximum(
            np.linalg.norm(mesh.face_vectors, axis=1, keepdims=True), np.finfo(float).tiny
        )

    def normals(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """The normal of the face nearest to each point."""
        return self._normals[self.distance.closest(points)[1]]

    def facing(self, surface: TSpline, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """Cosines between the surface normals and those of the mesh's nearest faces."""
        return dots(surface.normals(s, t), self.normals(surface.positions(s, t)))


@dataclass(frozen=True, eq=False)
class MeshSamples:
    """Points of the mesh, each with its place (s, t) on the surface, its distance from there and the area it
    stands for."""

    points: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    s: Float[ndarray, " n"]
    t: Float[ndarray, " n"]
    distances: Float[ndarray, " n"]

    def __add__(self, other: "MeshSamples") -> "MeshSamples":
        mine, others = ((x.points, x.areas, x.s, x.t, x.distances) for x in (self, other))
        return MeshSamples(*(np.concatenate(pair) for pair in zip(mine, others)))

    def on(self, surface: TSpline, tolerance: float) -> "MeshSamples":
        """The samples with the closest points of `surface`, followed from their parameters.

        Where few end farther away than `tolerance` (mm), these are sought again from the parameters of the
        sample whose surface point is nearest.
        """
        s, t, distances = follow_closest_points(surface, self.points, self.s, self.t, steps=3)
        far = np.flatnonzero(distances > tolerance)
        if 0 < len(far) < len(s) / DOUBTFUL:
            nearest = cKDTree(surface.positions(s, t)).query(self.points[far])[1]
            closest = follow_closest_points(surface, self.points[far], s[nearest], t[nearest], steps=6)
            met = closest[2] < np.minimum(tolerance, distances[far])
            for now, new in zip((s, t, distances), closest):
                now[far[met]] = new[met]
        return MeshSamples(self.points, self.areas, s, t, distances)


NOWHERE = MeshSamples(np.empty((0, 3)), *[np.empty(0)] * 4)
"""No samples."""


@dataclass(frozen=True, eq=False)
class FitTarget:
    """Samples of the mesh with their closest points on the surface (`inward`), and surface points that are
    far from the mesh, with the nearest points there (`outward`).

    The latter are sought in every element and, with a narrower limit, at `places` (s, t).
    """

    shape: MeshNormals
    inward: MeshSamples
    outward: MeshSamples
    places: Float[ndarray, "k 2"]

    @classmethod
    def of(cls, mesh: TriangleMesh, rows: Rows, samples: int) -> "FitTarget":
        """The target of a mesh at the parameters of the rows' harmonic field; its distances are infinite."""
        points, areas = sample_mesh(mesh, samples)
        s, t = harmonic_parameters(rows, points)
        inward = MeshSamples(points, areas, s, t, np.full(len(points), np.inf))
        return cls(MeshNormals(mesh), inward, NOWHERE, np.empty((0, 2)))

    @classmethod
    def at_feet(cls, mesh: TriangleMesh, surface: TSpline, samples: int, tolerance: float) -> "FitTarget":
        """The target of a mesh at the closest points of a surface that is near it; `tolerance` as in `on`."""
        points, areas = sample_mesh(mesh, samples)
        s, t, distances = follow_closest_points(surface, points, *nearest_on_grid(surface, points))
        inward = MeshSamples(points, areas, s, t, distances)
        return cls(MeshNormals(mesh), inward, NOWHERE, np.empty((0, 2))).on(surface, tolerance)

    @property
    def all(self) -> MeshSamples:
        """The samples of both directions."""
        return self.inward + self.outward

    @property
    def worst(self) -> float:
        """The largest distance, mm."""
        return float(max(self.inward.distances.max(), self.outward.distances.max(initial=0.0)))

    def folded(self, surface: TSpline) -> bool:
        """Whether the surface meets itself. That is tested only where some normal on a fine grid points
        into the mesh, which it does at sharp rims too.
        """
        s, t = np.meshgrid(np.arange(96) / 96, (1 - np.cos(np.linspace(0.03, np.pi - 0.03, 160))) / 2)
        if self.shape.facing(surface, s.ravel(), t.ravel()).min() >= 0:
            return False
        return len(self_intersections(surface.tessellate(FOLD_CHORD * self.shape.mesh.diagonal))) > 0

    def with_points(
        self, points: Float[ndarray, "k 3"], places: Float[ndarray, "p 2"], surface: TSpline
    ) -> "FitTarget":
        """The target with more samples, each standing for a typical area, and with more `places` (s, t)."""
        areas = np.full(len(points), np.median(self.inward.areas))
        s, t, distances = follow_closest_points(surface, points, *nearest_on_grid(surface, points))
        added = MeshSamples(points, areas, s, t, distances)
        return replace(self, inward=self.inward + added, places=np.vstack([self.places, places]))

    def denser(self, surface: TSpline) -> "FitTarget":
        """The target with more samples, where the control points are too many for those it has.

        Each starts from the parameters of the sample nearest to it in place and normal.
        """
        count = len(self.inward.points)
        if surface.tmesh.size * EACH <= count:
            return self
        points, areas = sample_mesh(self.shape.mesh, 2 * surface.tmesh.size * EACH)
        size = np.sqrt(self.inward.areas.mean())
        old, new = (np.hstack([p, size * self.shape.normals(p)]) for p in (self.inward.points, points))
        near = cKDTree(old).query(new)[1]
        s, t = self.inward.s[near], self.inward.t[near]
        s, t, distances = follow_closest_points(surface, points, s, t, steps=3)
        return replace(self, inward=MeshSamples(points, areas, s, t, distances))

    def on(self, surface: TSpline, tolerance: float) -> "FitTarget":
        """The target with the closest points of `surface`, and the surface points that miss the mesh now."""
        s, t, share = element_points(surface.elements().boxes, OUTWARD)
        limits = np.append(np.full(len(s), PULLED * tolerance), np.full(len(self.places), WATCHED * tolerance))
        s, t = np.append(s, self.places[:, 0]), np.append(t, self.places[:, 1])
        share = np.append(share, np.full(len(self.places), np.median(share)))
        S, Ss, St = surface.evaluate(s, t, 1)
        nearest = self.shape.distance.closest(S)[0]
        away = np.linalg.norm(S - nearest, axis=1)
        areas = share * np.linalg.norm(np.cross(Ss, St), axis=1)
        far = away > limits
        outward = MeshSamples(nearest[far], areas[far], s[far], t[far], away[far])
        return replace(self, inward=self.inward.on(surface, tolerance), outward=outward)


def harmonic_parameters(rows: Rows, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """(s, t) of points near the mesh, linear in each face between those of its vertices.

    Over the seam s is unwrapped from the corner that is farthest from the poles.
    """
    closest, faces = exact_closest(rows.mesh, points)
    corners = rows.mesh.faces[faces]
    weights = barycentric(rows.mesh.vertices[corners], closest)
    s, t = (rows.vertex_parameters[corners, k] for k in (0, 1))
    base = np.take_along_axis(s, np.abs(t - 0.5).argmin(axis=1)[:, None], axis=1)
    turned = np.mod(s - base + 0.5, 1.0) - 0.5
    turned[(t <= 0) | (t >= 1)] = 0.0
    return np.mod(base[:, 0] + (weights * turned).sum(axis=1), 1.0), np.clip((weights * t).sum(axis=1), 0.0, 1.0)


CHORD = 0.002
"""Chord tolerance of the tessellation that stands for the surface, mm."""
FARTHEST = 50
"""One in so many samples, the farthest, is projected with more care."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """The deviation of surface and mesh in both directions, mm.

    `max` is the larger of the two maxima, at `place`; `rms` is weighted by area over the samples of both.
    """

    max: float
    rms: float
    surface_to_mesh_max: float
    mesh_to_surface_max: float
    place: Float[ndarray, "3"]


@dataclass(frozen=True, eq=False)
class Measured:
    """Samples of the mesh with their distances to the surface (`inward`), samples of the surface with
    theirs to the mesh (`outward`), mm, and the area each stands for, mm^2.
    """

    mesh_points: Float[ndarray, "n 3"]
    inward: Float[ndarray, " n"]
    mesh_areas: Float[ndarray, " n"]
    surface_points: Float[ndarray, "m 3"]
    surface_places: Float[ndarray, "m 2"]
    nearest: Float[ndarray, "m 3"]
    outward: Float[ndarray, " m"]
    surface_areas: Float[ndarray, " m"]

    @property
    def deviation(self) -> Deviation:
        """The largest and the root mean square distance."""
        inward, outward = self.inward, self.outward
        squares = [np.average(d**2, weights=w) for d, w in ((inward, self.mesh_areas), (outward, self.surface_areas))]
        at_mesh = inward.max() >= outward.max()
        return Deviation(
            max=float(max(inward.max(), outward.max())),
            rms=float(np.sqrt(np.mean(squares))),
            surface_to_mesh_max=float(outward.max()),
            mesh_to_surface_max=float(inward.max()),
            place=self.mesh_points[np.argmax(inward)] if at_mesh else self.surface_points[np.argmax(outward)],
        )

    def missed(self, tolerance: float) -> tuple[Float[ndarray, "k 3"], Float[ndarray, "p 2"]]:
        """Points of the mesh that are, or that a surface sample finds, farther than the tolerance; and (s, t)
        of such surface samples."""
        far = self.outward > tolerance
        return np.vstack([self.mesh_points[self.inward > tolerance], self.nearest[far]]), self.surface_places[far]


def deviation(surface: TSpline, mesh: TriangleMesh, samples: int = 20000) -> Deviation:
    """How far surface and mesh are from each other."""
    return measure(surface, mesh, MeshDistance(mesh), samples).deviation


def distance_both_ways(surface: TSpline, mesh: TriangleMesh) -> tuple[float, float]:
    """The largest distance (mm) of the surface from a mesh, which may be open, and of the mesh from the
    surface, within CHORD: for meshes of any size, of which `deviation` projects every vertex."""
    return hausdorff(surface.tessellate(CHORD), mesh)


def measure(surface: TSpline, mesh: TriangleMesh, distance: MeshDistance, samples: int = 20000) -> Measured:
    """Surface samples to the mesh's nearest points and mesh samples (vertices, points in the faces) to their
    feet on the surface."""
    points, areas = sample_mesh(mesh, samples)
    s, t = nearest_on_grid(surface, points)
    _, _, inward = follow_closest_points(surface, points, s, t, steps=6)
    doubtful = np.argsort(-inward, kind="stable")[: max(1, len(points) // FARTHEST)]
    inward[doubtful] = np.minimum(inward[doubtful], surface.project(points[doubtful]).distances)
    along = int(np.ceil(np.sqrt(samples)))
    s, t = grid_parameters(surface, along, along)
    S, Ss, St = surface.evaluate(s, t, 1)
    nearest = distance.closest(S)[0]
    cells = np.linalg.norm(np.cross(Ss, St), axis=1)
    return Measured(
        mesh_points=points,
        inward=inward,
        mesh_areas=areas,
        surface_points=S,
        surface_places=np.column_stack([s, t]),
        nearest=nearest,
        outward=np.linalg.norm(S - nearest, axis=1),
        surface_areas=cells,
    )


LOOP_DAMPING = 1e-9
"""Weight of a control point's place between the rows' points, where these do not reach it."""

TRANSFER_DAMPING = 1e-6
"""Weight of a control point's place at its anchor, shared among them, where a surface moves to a T-mesh."""


def first_tmesh(spans: int, knots: int) -> RowTMesh:
    """Even spans in t, `knots` even knots a row, four in the rows next to the poles."""
    t_knots = np.concatenate([np.zeros(3), np.linspace(0, 1, spans + 1), np.ones(3)])
    rows = [np.arange(knots) / knots for _ in range(spans + 3)]
    rows[0] = rows[-1] = np.zeros(1)
    rows[1] = rows[-2] = np.arange(FEWEST) / FEWEST
    return RowTMesh.from_rows(t_knots, rows)


def through_loops(rows: Rows, tmesh: RowTMesh) -> TSpline:
    """The surface that meets the rows' loops and poles best, each at its parameters; faintly held by them at
    its anchors."""
    loops, count = rows.guides.shape[:2]
    order = np.arange(1, loops + 1) * (len(rows.heights) + 1) / (loops + 1)
    heights = np.interp(order, np.arange(len(rows.heights) + 2), [0.0, *rows.heights, 1.0])
    s = np.tile(np.arange(count) / count, loops)
    t = np.repeat(heights, count)
    weights = np.repeat(np.gradient(heights), count)
    basis = tmesh.blending(np.append(s, [0.0, 0.0]), np.append(t, [0.0, 1.0]))
    weighted = sp.diags_array(np.append(weights, [1.0, 1.0])) @ basis
    points = np.vstack([rows.guides.reshape(-1, 3), rows.poles])
    nets = np.concatenate(
        [np.repeat(rows.poles[:1, None], count, axis=1), rows.guides, np.repeat(rows.poles[1:, None], count, axis=1)]
    )
    anchor_s, anchor_t = anchors(tmesh)
    column = np.rint(anchor_s * count).astype(int) % count
    place = np.interp(anchor_t, [0.0, *heights, 1.0], np.arange(loops + 2))
    level = np.minimum(place.astype(int), loops)
    share = (place - level)[:, None]
    held = nets[level, column] * (1 - share) + nets[level + 1, column] * share
    normal = (basis.T @ weighted).toarray() + LOOP_DAMPING * np.eye(tmesh.size)
    return TSpline(tmesh, np.linalg.solve(normal, weighted.T @ points + LOOP_DAMPING * held), np.ones(tmesh.size))


def transfer(surface: TSpline, tmesh: RowTMesh) -> TSpline:
    """A surface on `tmesh` like `surface`: least squares in the Gauss points, faintly held at the anchors."""
    size = tmesh.size
    draft = TSpline(tmesh, surface.positions(*anchors(tmesh)), np.ones(size))
    s, t, share = element_points(draft.elements().boxes, 2)
    data = Term(draft.basis(s, t)[0], share[:, None, None] * np.eye(3), surface.positions(s, t))
    held = Term(
        sp.eye_array(size, format="csr"),
        np.broadcast_to(TRANSFER_DAMPING / size * np.eye(3), (size, 3, 3)),
        draft.control_points,
    )
    return TSpline(tmesh, Form.of([data, held], size).least(), np.ones(size))


def anchors(tmesh: RowTMesh) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """(s, t) of each control point: its knot and its row's Greville point."""
    t = [tmesh.t_knots[j + 1 : j + 4].mean() for j in range(len(tmesh.s_knots))]
    return np.concatenate(tmesh.s_knots), np.repeat(t, [len(row) for row in tmesh.s_knots])


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


def crease_rings(surface: TSpline) -> list[Ring]:
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
    for ring in crease_rings(surface):
        points[ring.points] -= ((ring.arms @ points) @ ring.normal)[:, None] * ring.normal
    return surface.with_control_points(points)


def pole_planes(surface: TSpline, weight: float) -> list[Term]:
    """Keeps the control points next to each pole in one plane with it, square to the area vector of their
    polygon now."""
    terms = []
    for ring in crease_rings(surface):
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
    for ring in crease_rings(surface):
        ellipse = np.column_stack([np.cos(2 * np.pi * ring.knots), np.sin(2 * np.pi * ring.knots)])
        off = np.eye(len(ellipse)) - ellipse @ np.linalg.pinv(ellipse)
        arms = ring.arms @ surface.control_points
        now = off @ arms
        within = free * np.sqrt((arms**2).sum(axis=1).mean())
        far = np.linalg.norm(now, axis=1)
        nearer = now * np.minimum(1.0, within / np.maximum(far, np.finfo(float).tiny))[:, None]
        terms.append(Term(sp.csr_array(off @ ring.arms), (weight * (far > within))[:, None, None] * np.eye(3), nearer))
    return terms
