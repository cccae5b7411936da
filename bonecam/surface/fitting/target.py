"""The samples of a mesh that a surface is fitted to, and the parameters of the closest surface points.

The first parameters come from the mesh itself, the harmonic height and the share round the row
(`Rows.vertex_parameters`): they are right in a groove too, where the closest point of a smooth surface lies
on the wrong side. Later closest points are followed from where they were. Beside a rim one may stay on the
wrong side, so the last samples that seem missed are also sought from the parameters of other samples.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import dots
from bonecam.mesh.distance import MeshDistance, barycentric, exact_closest
from bonecam.mesh.sections.harmonic_rows import Rows
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.basis.gauss import element_points
from bonecam.surface.fitting.mesh_samples import sample_mesh
from bonecam.surface.query.closest_point import follow_closest_points, nearest_on_grid
from bonecam.surface.tspline import TSpline

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
        none = np.empty(0)
        inward = MeshSamples(points, areas, s, t, np.full(len(points), np.inf))
        return cls(MeshNormals(mesh), inward, MeshSamples(np.empty((0, 3)), none, none, none, none), np.empty((0, 2)))

    @classmethod
    def at_feet(cls, mesh: TriangleMesh, surface: TSpline, samples: int, tolerance: float) -> "FitTarget":
        """The target of a mesh at the closest points of a surface that is near it; `tolerance` as in `on`."""
        points, areas = sample_mesh(mesh, samples)
        s, t, distances = follow_closest_points(surface, points, *nearest_on_grid(surface, points))
        none = np.empty(0)
        nowhere = MeshSamples(np.empty((0, 3)), none, none, none, none)
        inward = MeshSamples(points, areas, s, t, distances)
        return cls(MeshNormals(mesh), inward, nowhere, np.empty((0, 2))).on(surface, tolerance)

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
