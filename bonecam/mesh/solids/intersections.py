"""Self-intersections, found exactly (CGAL's predicates through libigl; detection only)."""

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh


def self_intersections(mesh: TriangleMesh) -> Int[ndarray, " k"]:
    """The faces that cut another face of the same mesh (touching along shared edges and corners is none), in
    rising order."""
    import igl.copyleft.cgal as cgal

    if not len(mesh.faces):
        return np.empty(0, dtype=np.int64)
    crossings = cgal.remesh_self_intersections(np.array(mesh.vertices), mesh.faces.astype(np.int64), detect_only=True)
    return np.unique(np.asarray(crossings[2], dtype=np.int64).ravel())
