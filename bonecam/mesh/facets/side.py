"""On which side of facets points lie (Xu et al. 2013, Eq. 21 and Fig. 4)."""

import numpy as np
from jaxtyping import Bool, Float
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


def above_contacts(locations: Float[ndarray, "n 3"], mesh: TriangleMesh) -> Bool[ndarray, " n"]:
    """Whether each cutter location lies above its contact, vertex i of the mesh: above the facets nearest to it,
    and on the outer side of its contact's tangent plane (n . O > 0, Eq. 21)."""
    outward = dots(vertex_normals(mesh), locations - mesh.vertices) > 0
    return np.asarray(outward & (heights_above(locations, mesh) > 0))
