"""The harmonic field from pole to pole: u = 0 at the lower, 1 at the upper, Laplace's equation between.

Cotangent weights (Pinkall & Polthier 1993), raised to a small positive floor where a pair of obtuse triangles
makes them smaller. With positive weights every vertex but the poles has a lower and a higher neighbour; then,
on a closed genus-0 mesh, Euler's formula leaves no saddle, so **every isoline is one closed loop**.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.mesh.facets.energy.elastic_energy import cotangent_weights
from bonecam.mesh.triangle_mesh import TriangleMesh

END_LENGTH = 1.0
"""Length of the end of a part along Z, in mean radii."""
WEIGHT_FLOOR = 0.02
"""Least edge weight; a regular triangle pair has 2 / sqrt(3) / 2 = 0.58."""


def end_poles(mesh: TriangleMesh) -> Int[ndarray, "2"]:
    """The vertices in the middle of the lower and of the upper end along Z.

    An end is the part of the mesh within END_LENGTH mean radii of the lowest or the highest point; its middle
    is the vertex nearest to where the axis through its centroid leaves the mesh. (A pole at the very lowest
    point, often a corner at the rim, would crowd the rows on one side.)
    """
    heights = mesh.vertices[:, 2]
    corners = mesh.vertices[mesh.faces]
    radius = mesh.area / (2 * np.pi * np.ptp(heights))
    centres = corners.mean(axis=1)
    areas = np.linalg.norm(mesh.face_vectors, axis=1)
    poles = []
    for sign, end in ((-1.0, heights.min()), (1.0, heights.max())):
        cap = (end - centres[:, 2]) * sign < END_LENGTH * radius
        middle = np.average(centres[cap], axis=0, weights=areas[cap])
        outward = cap & (mesh.face_vectors[:, 2] * sign > 0)
        candidates = np.unique(mesh.faces[outward if outward.any() else cap])
        away = np.linalg.norm(mesh.vertices[candidates, :2] - middle[:2], axis=1)
        poles.append(int(candidates[np.argmin(away)]))
    return np.array(poles)


def harmonic_field(mesh: TriangleMesh, poles: Int[ndarray, "2"]) -> Float[ndarray, " v"]:
    """The field at each vertex: 0 at the vertex poles[0], 1 at poles[1], harmonic between."""
    laplacian = positive_laplacian(mesh)
    count = len(mesh.vertices)
    free = np.setdiff1d(np.arange(count), poles)
    u = np.zeros(count)
    u[poles[1]] = 1.0
    u[free] = spl.spsolve(laplacian[free][:, free].tocsc(), -laplacian[free] @ u)
    return u


def positive_laplacian(mesh: TriangleMesh) -> sp.csr_array:
    """The (v, v) cotangent Laplacian, rows summing to zero, off-diagonals at most -WEIGHT_FLOOR."""
    weights = cotangent_weights(mesh)
    weights.data = np.maximum(weights.data, WEIGHT_FLOOR)
    return (sp.diags_array(weights.sum(1)) - weights).tocsr()
