"""The convex hull, closed in every case: CGAL's through libigl, whose predicates are exact. (Qhull's merged
facets may leave cracks.)"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh


def convex_hull(points: Float[ndarray, "n 3"]) -> TriangleMesh:
    """The closed outward mesh of the hull of points that lie in no common plane; points within the hull are
    left out."""
    import igl.copyleft.cgal as cgal

    corners, index = np.unique(cgal.convex_hull(np.array(points, dtype=np.float64)), return_inverse=True)
    return TriangleMesh(points[corners], index.reshape(-1, 3).astype(np.int32))
