"""What is fitted: samples of a mesh with their areas, and where their feet on the surface are now.

The first feet come from the mesh itself, the harmonic height and the share round the row (`Rows.vertex_parameters`): they are right in a
groove too, where the nearest point of a smooth surface lies on the wrong side. Later feet are followed from where they were.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance, exact_closest
from bonecam.mesh.sections import Rows
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.feet import follow
from bonecam.surface.samples import sample_mesh
from bonecam.surface.tspline import TSpline


class Shape:
    """The mesh, asked for the normal nearest to a point."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self._distance = MeshDistance(mesh)
        self._normals = mesh.face_vectors / np.maximum(np.linalg.norm(mesh.face_vectors, axis=1, keepdims=True), np.finfo(float).tiny)

    def normals(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """The normal of the face nearest to each point."""
        return np.asarray(self._normals[self._distance.closest(points)[1]])

    def facing(self, surface: TSpline, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """Cosines between the surface normals and those of the mesh's nearest faces."""
        return np.asarray(np.einsum("ij,ij->i", surface.normals(s, t), self.normals(surface.positions(s, t))))


@dataclass(frozen=True, eq=False)
class Target:
    """Samples of the mesh with their areas, and where their feet are now."""

    shape: Shape
    points: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    s: Float[ndarray, " n"]
    t: Float[ndarray, " n"]
    distances: Float[ndarray, " n"]

    @classmethod
    def of(cls, mesh: TriangleMesh, rows: Rows, samples: int) -> "Target":
        """With the parameters of the rows' harmonic field as feet; no distances yet."""
        points, areas = sample_mesh(mesh, samples)
        shape = Shape(mesh)
        s, t = harmonic_parameters(rows, points)
        return cls(shape, points, areas, s, t, np.full(len(points), np.inf))

    def on(self, surface: TSpline, rounds: int = 3) -> "Target":
        """With the feet followed from where they were."""
        s, t, distances = follow(surface, self.points, self.s, self.t, rounds=rounds)
        return replace(self, s=s, t=t, distances=distances)


def harmonic_parameters(rows: Rows, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """(s, t) of points near the mesh: those of its vertices, linear in the face, s unwrapped from the corner farthest from the poles."""
    closest, faces = exact_closest(rows.mesh, points)
    corners = rows.mesh.faces[faces]
    weights = barycentric(rows.mesh.vertices[corners], closest)
    s, t = (rows.vertex_parameters[corners, k] for k in (0, 1))
    base = np.take_along_axis(s, np.abs(t - 0.5).argmin(axis=1)[:, None], axis=1)
    turned = np.mod(s - base + 0.5, 1.0) - 0.5
    turned[(t <= 0) | (t >= 1)] = 0.0
    return np.mod(base[:, 0] + (weights * turned).sum(axis=1), 1.0), np.clip((weights * t).sum(axis=1), 0.0, 1.0)


def barycentric(corners: Float[ndarray, "n 3 3"], points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Weights of the corners of each triangle at a point in it, clipped to it."""
    a, b, c = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb, ac, bc = (np.einsum("ij,ij->i", x, y) for x, y in ((a, a), (a, b), (b, b), (a, c), (b, c)))
    scale = 1 / np.maximum(aa * bb - ab * ab, np.finfo(float).tiny)
    v, w = (bb * ac - ab * bc) * scale, (aa * bc - ab * ac) * scale
    weights = np.clip(np.column_stack([1 - v - w, v, w]), 0, 1)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
