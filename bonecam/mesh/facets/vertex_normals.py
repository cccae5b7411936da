"""Normals of a mesh's vertices."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh.triangle_mesh import TriangleMesh


def vertex_normals(mesh: TriangleMesh) -> Float[ndarray, "n 3"]:
    """Unit normals: the sum of the cross products of the faces round each vertex, not normalised before, so that
    each face counts by its area (Xu et al. 2013, Eq. 19).

    MeshError where a vertex has no face, or its faces cancel.
    """
    sums = np.zeros((len(mesh.vertices), 3))
    for corner in mesh.faces.T:
        np.add.at(sums, corner, mesh.face_vectors)
    lengths = np.linalg.norm(sums, axis=1)
    if len(lengths) and not lengths.min() > 0:
        vertex = int(np.argmin(lengths))
        raise MeshError(
            f"vertex {vertex} has no normal: remove vertices without faces, and faces without area", vertex=vertex
        )
    return np.asarray(sums / lengths[:, None])
