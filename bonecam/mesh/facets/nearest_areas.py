"""The area of a mesh about points on it."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.mesh.triangle_mesh import TriangleMesh


def nearest_areas(mesh: TriangleMesh, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """The area (mm^2) that each point stands for: that of the faces whose middles are nearer to it than to any other.

    They add up to the area of the mesh. ValueError without points.
    """
    if not len(points):
        raise ValueError("no point to share the area of the mesh among")
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    return np.bincount(KDTree(points).query(corners.mean(axis=1))[1], areas, len(points))
