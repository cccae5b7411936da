"""What a picture shows of a mesh: where a plane cuts it, from where it is seen, and the normals that shade
it."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.healing.topology import edges_of
from bonecam.mesh.triangle_mesh import TriangleMesh

SHARP = np.radians(25.0)
"""Where a face turns by more from the mean normal at a vertex, faces meet sharply and are shaded by their own
normals."""


def section(
    mesh: TriangleMesh, origin: Float[ndarray, "3"], normal: Float[ndarray, "3"]
) -> Float[ndarray, "k 2 3"]:
    """The segments in which the plane through `origin` cuts the triangles, mm."""
    height = (mesh.vertices - origin) @ normal
    height = np.where(height == 0, np.finfo(float).eps, height)
    sides = height[mesh.faces] > 0
    crossed = np.flatnonzero(sides.any(1) & ~sides.all(1))
    ends = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        first, second = mesh.faces[crossed, a], mesh.faces[crossed, b]
        with np.errstate(all="ignore"):
            ratio = height[first] / (height[first] - height[second])
            point = mesh.vertices[first] + ratio[:, None] * (mesh.vertices[second] - mesh.vertices[first])
        ends.append(np.where((sides[crossed, a] != sides[crossed, b])[:, None], point, np.nan))
    stacked = np.stack(ends, axis=1)
    return stacked[~np.isnan(stacked[:, :, 0])].reshape(-1, 2, 3)


def view(mesh: TriangleMesh) -> Float[ndarray, "3 3"]:
    """Axes (rows: to the right, away from the viewer, up) to look along: y at a closed mesh, at an open one
    what shows most area."""
    looks = np.vstack([np.eye(3)[1], -np.eye(3), np.eye(3)])
    shown = np.maximum(-mesh.face_vectors @ looks.T, 0).sum(axis=0)
    is_open = (edges_of(mesh)[1] == 1).any()
    look = looks[shown.argmax() if is_open else 0]
    up = np.eye(3)[1 if look[2] else 2]
    return np.array([np.cross(look, up), look, up])


def corner_normals(mesh: TriangleMesh) -> Float[ndarray, "f 3 3"]:
    """A unit normal at each corner of each face: the mean of the faces round the vertex, or where they meet
    sharply the face's own."""
    tiny, area = np.finfo(float).tiny, np.linalg.norm(mesh.face_vectors, axis=1)
    own, mean = mesh.face_vectors / np.maximum(area, tiny)[:, None], np.zeros((len(mesh.vertices), 3))
    for corner in mesh.faces.T:
        np.add.at(mean, corner, mesh.face_vectors)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), tiny)
    least = np.ones(len(mesh.vertices))
    for corner in mesh.faces[area > 0].T:
        np.minimum.at(least, corner, (mean[corner] * own[area > 0]).sum(axis=1))
    return np.where((least < np.cos(SHARP))[mesh.faces][:, :, None], own[:, None], mean[mesh.faces])
