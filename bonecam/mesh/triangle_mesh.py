"""The mesh that passes between stages: vertices (n, 3) in mm and faces (m, 3), outward by the right hand."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int32
from numpy import ndarray

from bonecam.arrays import frozen


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles with shared vertices; mm; counter-clockwise seen from outside.

    Raises ValueError where a face names a vertex that is not there or a coordinate is not finite.
    """

    vertices: Float[ndarray, "n 3"]
    faces: Int32[ndarray, "m 3"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices).reshape(-1, 3))
        object.__setattr__(self, "faces", frozen(self.faces, np.int32).reshape(-1, 3))
        if not np.isfinite(self.vertices).all():
            raise ValueError(f"vertex {int(np.argmin(np.isfinite(self.vertices).all(1)))} is not finite")
        if len(self.faces) and not (self.faces.min() >= 0 and self.faces.max() < len(self.vertices)):
            raise ValueError(f"faces name vertices outside 0..{len(self.vertices) - 1}")

    @cached_property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner, mm."""
        return np.array([self.vertices.min(0), self.vertices.max(0)])

    @cached_property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, mm."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @cached_property
    def face_vectors(self) -> Float[ndarray, "m 3"]:
        """Outward normals scaled by twice the face areas, mm^2."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def area(self) -> float:
        """Surface area, mm^2."""
        return float(np.linalg.norm(self.face_vectors, axis=1).sum() / 2)

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, mm^3; negative where the faces point inwards."""
        return float(np.einsum("ij,ij->", self.vertices[self.faces[:, 0]], self.face_vectors) / 6)

    def move(self, transform: Float[ndarray, "4 4"]) -> "TriangleMesh":
        """The mesh under a rigid transform (4, 4), in mm."""
        return TriangleMesh(self.vertices @ transform[:3, :3].T + transform[:3, 3], self.faces)


def probes(mesh: TriangleMesh) -> Float[ndarray, "n 3"]:
    """The mesh's vertices and the middles of its faces."""
    return np.vstack([mesh.vertices, mesh.vertices[mesh.faces].mean(1)])


def keep_faces(mesh: TriangleMesh, kept: Bool[ndarray, " m"] | slice = slice(None)) -> TriangleMesh:
    """The mesh of the `kept` faces and the vertices they name."""
    used, faces = np.unique(mesh.faces[kept], return_inverse=True)
    return TriangleMesh(mesh.vertices[used], faces.reshape(-1, 3).astype(np.int32))
