"""Samples of a mesh: its vertices and points inside its faces, each with the area it stands for."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh


def sample_mesh(mesh: TriangleMesh, count: int) -> tuple[Float[ndarray, "n 3"], Float[ndarray, " n"]]:
    """All vertices and about `count` points inside the faces, evenly by area; and areas (mm^2) that add up to
    the mesh's area.

    A face gets k^2 points, the centres of its k^2 similar parts, where k^2 is its share rounded up.
    Deterministic.
    """
    areas = np.linalg.norm(mesh.face_vectors, axis=1) / 2
    parts = np.ceil(np.sqrt(count * areas / areas.sum()) - 0.2).clip(1).astype(np.int64)
    points = [mesh.vertices]
    weights = [_vertex_areas(mesh, areas) / 4]
    for k in np.unique(parts):
        chosen = parts == k
        corners = mesh.vertices[mesh.faces[chosen]]
        inside = np.einsum("qc,fcd->fqd", _centres(int(k)), corners).reshape(-1, 3)
        points.append(inside)
        weights.append(np.repeat(0.75 * areas[chosen] / k**2, k**2))
    return np.vstack(points), np.concatenate(weights)


def _vertex_areas(mesh: TriangleMesh, areas: ndarray) -> ndarray:
    """A third of the faces around each vertex, times 1."""
    return np.bincount(mesh.faces.ravel(), np.repeat(areas / 3, 3), minlength=len(mesh.vertices))


def _centres(k: int) -> Float[ndarray, "q 3"]:
    """Barycentric centres of the k^2 similar parts of a triangle."""
    i, j = (v.ravel() for v in np.meshgrid(np.arange(k), np.arange(k)))
    up = i + j < k
    down = i + j < k - 1
    first = np.column_stack([i[up] + 1 / 3, j[up] + 1 / 3])
    second = np.column_stack([i[down] + 2 / 3, j[down] + 2 / 3])
    two = np.vstack([first, second]) / k
    return np.column_stack([two, 1 - two.sum(axis=1)])
