"""Areas of the Voronoi cells of a mesh's vertices on its faces (Xu et al. 2013, Eq. 10; Meyer et al. 2003).

In a face without an obtuse angle a corner's cell goes as far as the circumcentre: the corner has an eighth of
l^2 cot(a) for each of its two sides, l long and opposite the angle a. Where an angle is obtuse the circumcentre lies
outside: its corner has half of the face, the others a quarter each.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh


def voronoi_areas(mesh: TriangleMesh) -> Float[ndarray, " n"]:
    """The area (mm^2) of each vertex's cell; they add up to the area of the mesh. 0 of a vertex without faces."""
    corners = mesh.vertices[mesh.faces]
    whole = np.linalg.norm(mesh.face_vectors, axis=1)
    doubled = np.maximum(whole, np.finfo(float).tiny)
    to_next, to_last = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cosines = (to_next * to_last).sum(axis=2)
    opposite = ((to_next - to_last) ** 2).sum(axis=2) * cosines / doubled[:, None]
    acute = (opposite.sum(axis=1, keepdims=True) - opposite) / 8
    obtuse = cosines < 0
    halves = whole[:, None] / np.where(obtuse, 4, 8)
    shares = np.where(obtuse.any(axis=1, keepdims=True), halves, acute)
    return np.bincount(mesh.faces.ravel(), shares.ravel(), len(mesh.vertices))
