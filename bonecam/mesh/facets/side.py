"""On which side of facets points lie (Xu et al. 2013, Eq. 21 and Fig. 4)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, unit
from bonecam.mesh.distance import barycentric, exact_closest
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh


def heights_above(points: Float[ndarray, "k 3"], mesh: TriangleMesh) -> Float[ndarray, " k"]:
    """(p - q) . n for each point p, mm: q is the point of the mesh, open or closed, nearest to p, n the normal
    there, interpolated between the vertices. Positive above.

    Eq. 21 holds near the facets only: far out, the nearest point moves away from the contact.
    """
    nearest, faces = exact_closest(mesh, points)
    corners = mesh.faces[faces]
    shares = barycentric(mesh.vertices[corners], nearest)
    normals = unit(np.einsum("kc,kcd->kd", shares, vertex_normals(mesh)[corners]))
    return dots(points - nearest, normals)
