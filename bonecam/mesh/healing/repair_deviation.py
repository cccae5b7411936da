"""How far a repair moved the surface."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import exact_closest
from bonecam.mesh.triangle_mesh import TriangleMesh

ASIDE = 1e-4
"""How far beside a face its two sides are looked at, as a share of the diagonal."""


def largest_deviation(
    before: TriangleMesh, cleaned: TriangleMesh, after: TriangleMesh
) -> tuple[float, Float[ndarray, "3"]]:
    """Largest distance (mm) from the corners and middles of the old faces to the new surface, and where.

    Old faces with the solid on both sides lie inside another part of the surface: they are no outside and do
    not count.
    """
    import igl

    corners = before.vertices[before.faces]
    vectors = before.face_vectors
    middles = corners.mean(1, keepdims=True)
    points = np.concatenate([corners, middles], axis=1).reshape(-1, 3)
    distances = np.linalg.norm(exact_closest(after, points)[0] - points, axis=1)
    normals = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny)
    aside = np.repeat(normals, 4, axis=0) * before.diagonal * ASIDE
    inset = (points.reshape(-1, 4, 3) + ASIDE * (middles - points.reshape(-1, 4, 3))).reshape(-1, 3)
    solid = np.array(cleaned.vertices), cleaned.faces.astype(np.int64)
    within = [np.asarray(igl.winding_number(*solid, inset + side * aside)).ravel() > 0.5 for side in (1, -1)]
    distances[within[0] & within[1]] = 0.0
    worst = int(np.argmax(distances))
    return float(distances[worst]), points[worst]
