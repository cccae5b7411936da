"""The mesh that passes between stages: vertices (n, 3) in mm and faces (m, 3), outward by the right hand.

Meshes of open3d, trimesh, pymeshlab and pyvista come in by `mesh_from` and go out by the methods `to_...`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int32
from numpy import ndarray
from numpy.typing import ArrayLike

from bonecam.arrays import frozen
from bonecam.runtime.loading import loaded_once


@runtime_checkable
class Open3dMesh(Protocol):
    """What is read of an open3d.geometry.TriangleMesh."""

    vertices: Any
    triangles: Any


@runtime_checkable
class Open3dTensorMesh(Protocol):
    """What is read of an open3d.t.geometry.TriangleMesh."""

    vertex: Any
    triangle: Any


@runtime_checkable
class TrimeshMesh(Protocol):
    """What is read of a trimesh.Trimesh."""

    vertices: Any
    faces: Any


@runtime_checkable
class TrimeshScene(Protocol):
    """What is read of a trimesh.Scene, which trimesh.load gives of some files."""

    def to_mesh(self) -> Any:
        """Its meshes in one trimesh.Trimesh, each where the scene has it."""


@runtime_checkable
class PymeshlabMesh(Protocol):
    """What is read of a pymeshlab.Mesh."""

    def vertex_matrix(self) -> Any:
        """Vertices (n, 3)."""

    def face_matrix(self) -> Any:
        """Faces (m, 3)."""


@runtime_checkable
class PyvistaMesh(Protocol):
    """What is read of a pyvista.PolyData, or of another data set of pyvista with a surface."""

    def extract_surface(self) -> Any:
        """Its surface, a pyvista.PolyData."""


LARGEST_COORDINATE = 1e9
"""Larger coordinates, in the file's own unit, are refused as damaged."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles with shared vertices; mm; counter-clockwise seen from outside.

    Raises ValueError where the arrays have another shape or type, a face names a vertex that is not there, or a
    coordinate is not finite or above LARGEST_COORDINATE.
    """

    vertices: Float[ndarray, "n 3"]
    faces: Int32[ndarray, "m 3"]

    def __post_init__(self) -> None:
        vertices, faces = _checked(self.vertices, self.faces)
        object.__setattr__(self, "vertices", frozen(vertices))
        object.__setattr__(self, "faces", frozen(faces, np.int32))
        if not np.isfinite(self.vertices).all():
            raise ValueError(f"vertex {int(np.argmin(np.isfinite(self.vertices).all(1)))} is not finite")
        largest = np.abs(self.vertices).max(axis=1, initial=0.0)
        if largest.max(initial=0.0) > LARGEST_COORDINATE:
            vertex = int(np.argmax(largest))
            bound = f"give at most {LARGEST_COORDINATE:g}"
            raise ValueError(f"vertex {vertex} has a coordinate of {largest[vertex]:.3g}: {bound}")

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
        turned = np.einsum("ij,kj->ik", self.vertices, transform[:3, :3])  # as every processor does it
        return TriangleMesh(turned + transform[:3, 3], self.faces)

    def __repr__(self) -> str:
        size = " x ".join(f"{length:.4g}" for length in np.ptp(self.bounds, axis=0)) if len(self.vertices) else "0"
        return f"TriangleMesh({len(self.vertices)} vertices, {len(self.faces)} faces, {size} mm)"

    def to_open3d(self) -> Any:
        """An open3d.geometry.TriangleMesh with copies of vertices and faces."""
        geometry, utility = _open3d()
        vertices = utility.Vector3dVector(self.vertices.copy())
        return geometry.TriangleMesh(vertices, utility.Vector3iVector(self.faces.copy()))

    def to_trimesh(self) -> Any:
        """A trimesh.Trimesh with copies of vertices and faces, in their order; needs the package trimesh."""
        from trimesh import Trimesh

        return Trimesh(self.vertices.copy(), self.faces.copy(), process=False)


MeshLike = (
    TriangleMesh
    | Open3dMesh
    | Open3dTensorMesh
    | TrimeshMesh
    | TrimeshScene
    | PymeshlabMesh
    | PyvistaMesh
    | tuple[ArrayLike, ArrayLike]
)
"""A mesh in memory: vertices and faces as two arrays, or a mesh of one of these libraries."""


@loaded_once
def _open3d() -> tuple[Any, Any]:
    """open3d's modules `geometry` and `utility`."""
    from open3d import geometry, utility

    return geometry, utility


def mesh_from(source: object) -> TriangleMesh:
    """The triangles of a mesh in memory (`MeshLike`), in its own unit.

    TypeError where `source` is no such mesh, ValueError where its arrays are no triangles between its vertices.
    """
    if isinstance(source, TriangleMesh):
        return source
    vertices, faces = _checked(*_arrays_of(source))
    return TriangleMesh(vertices, faces)


def _checked(vertices: Any, faces: Any) -> tuple[Float[ndarray, "n 3"], Int32[ndarray, "m 3"]]:
    """The two arrays of a mesh as numbers of the right type. ValueError where they are no triangles between its
    vertices."""
    given = {"vertices": np.asarray(vertices), "faces": np.asarray(faces)}
    for name, array in given.items():
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(f"{name} have the shape {array.shape}: give three numbers a row")
    points, corners = given.values()
    if points.dtype.kind not in "fiu":
        raise ValueError(f"vertices hold {points.dtype} values: give numbers")
    if corners.size and corners.dtype.kind not in "iu":
        raise ValueError(f"faces hold {corners.dtype} numbers: give the indices of vertices as whole numbers")
    if corners.size and not (corners.min() >= 0 and corners.max() < len(points)):
        raise ValueError(f"faces name vertices outside 0..{len(points) - 1}")
    return points.astype(np.float64, copy=False), corners.astype(np.int32, copy=False)


def _arrays_of(source: Any) -> tuple[Any, ...]:
    """Vertices and faces of a mesh in memory, as its library keeps them."""
    if isinstance(source, tuple | list) and len(source) == 2:
        return source[0], source[1]
    if isinstance(source, PymeshlabMesh):
        return source.vertex_matrix(), source.face_matrix()
    if isinstance(source, PyvistaMesh):
        surface = source.extract_surface().triangulate()
        return surface.points, surface.faces.reshape(-1, 4)[:, 1:]  # each with its 3, the number of its corners
    if isinstance(source, TrimeshMesh):  # before open3d's: it has `triangles` too, as coordinates
        return source.vertices, source.faces
    if isinstance(source, TrimeshScene):
        return _arrays_of(source.to_mesh())
    if isinstance(source, Open3dMesh):
        return source.vertices, source.triangles
    if isinstance(source, Open3dTensorMesh):
        stored = ((source.vertex, "positions"), (source.triangle, "indices"))
        return tuple(table[key].numpy() if key in table else np.zeros((0, 3)) for table, key in stored)
    raise TypeError(
        f"the mesh is of type {type(source).__name__}: give (vertices, faces), a bonecam.TriangleMesh, or a mesh of "
        "open3d, trimesh, pymeshlab or pyvista"
    )


def probes(mesh: TriangleMesh) -> Float[ndarray, "n 3"]:
    """The mesh's vertices and the middles of its faces."""
    return np.vstack([mesh.vertices, mesh.vertices[mesh.faces].mean(1)])


def side_by_side(meshes: Sequence["TriangleMesh"]) -> "TriangleMesh":
    """Meshes as one; solids that do not enter one another are one solid of several pieces."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.vstack([mesh.faces + start for mesh, start in zip(meshes, starts)])
    return TriangleMesh(np.vstack([mesh.vertices for mesh in meshes]), faces.astype(np.int32))


def keep_faces(mesh: TriangleMesh, kept: Bool[ndarray, " m"] | slice = slice(None)) -> TriangleMesh:
    """The mesh of the `kept` faces and the vertices they name."""
    used, faces = np.unique(mesh.faces[kept], return_inverse=True)
    return TriangleMesh(mesh.vertices[used], faces.reshape(-1, 3).astype(np.int32))
