"""What a picture shows of a mesh: where a plane cuts it, from where it is seen, and the normals that shade
it."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.healing.topology import edges_of
from bonecam.mesh.triangle_mesh import TriangleMesh

SHARP_ANGLE = np.radians(25.0)
"""Where a face turns by more (radians) from the mean normal at a vertex, faces meet sharply there and are
shaded by their own normals."""


def section(mesh: TriangleMesh, origin: Float[ndarray, "3"], normal: Float[ndarray, "3"]) -> Float[ndarray, "k 2 3"]:
    """The segments in which the plane through `origin` cuts the triangles, mm."""
    height = (mesh.vertices - origin) @ normal
    height = np.where(height == 0, np.finfo(float).eps, height)
    above = height[mesh.faces] > 0
    crossed = np.flatnonzero(above.any(1) & ~above.all(1))
    ends = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        first, second = mesh.faces[crossed, a], mesh.faces[crossed, b]
        with np.errstate(all="ignore"):
            ratio = height[first] / (height[first] - height[second])
            point = mesh.vertices[first] + ratio[:, None] * (mesh.vertices[second] - mesh.vertices[first])
        crosses = above[crossed, a] != above[crossed, b]
        ends.append(np.where(crosses[:, None], point, np.nan))
    stacked = np.stack(ends, axis=1)
    return stacked[~np.isnan(stacked[:, :, 0])].reshape(-1, 2, 3)


def is_closed(mesh: TriangleMesh) -> bool:
    """Whether every edge has a second face."""
    return not (edges_of(mesh)[1] == 1).any()


def view(mesh: TriangleMesh) -> Float[ndarray, "3 3"]:
    """Axes (rows: to the right, away from the viewer, up) to look along: y at a closed mesh, at an open one
    the direction that shows most area."""
    directions = np.vstack([np.eye(3)[1], -np.eye(3), np.eye(3)])
    shown_area = np.maximum(-mesh.face_vectors @ directions.T, 0).sum(axis=0)
    away = directions[0 if is_closed(mesh) else shown_area.argmax()]
    up = np.eye(3)[1 if away[2] else 2]
    return np.array([np.cross(away, up), away, up])


def corner_normals(mesh: TriangleMesh) -> Float[ndarray, "f 3 3"]:
    """A unit normal at each corner of each face: the area-weighted mean of the faces round the vertex, or
    where they meet sharply the face's own."""
    tiny = np.finfo(float).tiny
    area = np.linalg.norm(mesh.face_vectors, axis=1)
    own = mesh.face_vectors / np.maximum(area, tiny)[:, None]
    mean = np.zeros((len(mesh.vertices), 3))
    for corner in mesh.faces.T:
        np.add.at(mean, corner, mesh.face_vectors)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), tiny)

    least_cosine = np.ones(len(mesh.vertices))
    for corner in mesh.faces[area > 0].T:
        np.minimum.at(least_cosine, corner, (mean[corner] * own[area > 0]).sum(axis=1))
    sharp = (least_cosine < np.cos(SHARP_ANGLE))[mesh.faces]
    return np.where(sharp[:, :, None], own[:, None], mean[mesh.faces])
