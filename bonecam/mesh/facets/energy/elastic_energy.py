"""Elastic energy of values at the vertices of a mesh (Xu et al. 2013, Eq. 22):

    E = alpha / 2 int |grad r|^2 + beta / 2 int (laplacian r)^2

With linear values on the faces the membrane is r L r / 2, L the cotangent Laplacian (Pinkall & Polthier 1993). The
thin plate is |A^-1/2 L r|^2 / 2 over the vertices inside, A the areas of their Voronoi cells. Differs from the paper
in:

1. Integrals are over the surface, not over its parameters, which stretch it.
2. The printed r_uu^2 + 2 r_uv^2 + r_vv^2 and (r_uu + r_vv)^2 have integrals that differ on the boundary alone.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse import coo_array, csr_array, diags_array

from bonecam.mesh.facets.energy.voronoi_areas import voronoi_areas
from bonecam.mesh.triangle_mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class ElasticEnergy:
    """The energy on a mesh: `stiffness` is L (v, v), `plate` A^-1/2 L (v, v), its rows zero on the boundary."""

    stiffness: csr_array
    plate: csr_array

    @classmethod
    def of(cls, mesh: TriangleMesh) -> "ElasticEnergy":
        """The energy on the faces of a mesh, open or closed."""
        weights = cotangent_weights(mesh)
        stiffness = diags_array(weights.sum(axis=1)) - weights
        inside = _inside(mesh)
        areas = np.where(inside, voronoi_areas(mesh), 1.0)
        plate = diags_array(inside / np.sqrt(areas)) @ stiffness
        return cls(stiffness.tocsr(), plate.tocsr())

    def matrix(self, alpha: float, beta: float) -> csr_array:
        """The symmetric H (v, v) with E = r H r / 2."""
        return (alpha * self.stiffness + beta * (self.plate.T @ self.plate)).tocsr()

    def of_values(self, values: Float[ndarray, "v d"], alpha: float, beta: float) -> float:
        """E of values at the vertices, such as unit tool axes."""
        return float((values * (self.matrix(alpha, beta) @ values)).sum() / 2)


def cotangent_weights(mesh: TriangleMesh) -> csr_array:
    """For each edge half the sum of the cotangents of the angles opposite to it: symmetric (v, v)."""
    count = len(mesh.vertices)
    corners = mesh.vertices[mesh.faces]
    starts = []
    ends = []
    cotangents = []
    for k in range(3):
        to_next = corners[:, (k + 1) % 3] - corners[:, k]
        to_last = corners[:, (k + 2) % 3] - corners[:, k]
        sines = np.linalg.norm(np.cross(to_next, to_last), axis=1)
        cotangents.append(0.5 * (to_next * to_last).sum(1) / sines)
        starts.append(mesh.faces[:, (k + 1) % 3])
        ends.append(mesh.faces[:, (k + 2) % 3])
    half = coo_array(
        (np.concatenate(cotangents), (np.concatenate(starts), np.concatenate(ends))), shape=(count, count)
    ).tocsr()
    return (half + half.T).tocsr()


def _inside(mesh: TriangleMesh) -> ndarray:
    """Which vertices have faces all round."""
    sides = np.vstack([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)])
    ordered, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    inside = np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices)) > 0
    inside[ordered[count == 1].ravel()] = False
    return inside
