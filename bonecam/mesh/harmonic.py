"""The harmonic field from pole to pole: u = 0 at the lower, 1 at the upper, Laplace's equation between.

Cotangent weights (Pinkall & Polthier 1993), raised to a small positive floor where a pair of obtuse triangles makes
them smaller. With positive weights every vertex but the poles has a lower and a higher neighbour; then, on a closed
genus-0 mesh, Euler's formula leaves no saddle, so **every isoline is one closed loop**.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh

WEIGHT_FLOOR = 0.02
"""Least edge weight; a regular triangle pair has 2 / sqrt(3) / 2 = 0.58."""


def end_poles(mesh: TriangleMesh) -> Int[ndarray, "2"]:
    """The lowest and the highest vertex along Z."""
    heights = mesh.vertices[:, 2]
    return np.array([int(np.argmin(heights)), int(np.argmax(heights))])


def harmonic_field(mesh: TriangleMesh, poles: Int[ndarray, "2"]) -> Float[ndarray, " v"]:
    """u at each vertex: 0 at poles[0], 1 at poles[1], harmonic between."""
    laplacian = positive_laplacian(mesh)
    count = len(mesh.vertices)
    free = np.setdiff1d(np.arange(count), poles)
    u = np.zeros(count)
    u[poles[1]] = 1.0
    u[free] = spl.spsolve(laplacian[free][:, free].tocsc(), -laplacian[free] @ u)
    return u


def positive_laplacian(mesh: TriangleMesh) -> sp.csr_array:
    """The (v, v) cotangent Laplacian, rows summing to zero, off-diagonals at most -WEIGHT_FLOOR."""
    count = len(mesh.vertices)
    corners = mesh.vertices[mesh.faces]
    starts, ends, cotangents = [], [], []
    for k in range(3):
        one, two = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        cotangents.append(0.5 * (one * two).sum(1) / np.linalg.norm(np.cross(one, two), axis=1))
        starts.append(mesh.faces[:, (k + 1) % 3])
        ends.append(mesh.faces[:, (k + 2) % 3])
    half = sp.coo_array((np.concatenate(cotangents), (np.concatenate(starts), np.concatenate(ends))), shape=(count, count)).tocsr()
    weights = (half + half.T).tocsr()
    weights.data = np.maximum(weights.data, WEIGHT_FLOOR)
    return (sp.diags_array(weights.sum(1)) - weights).tocsr()
