"""The closed mesh of what stands: through the vertices that balls have lowered, and out to what rays tell beyond it."""

import numpy as np
from jaxtyping import Float, Int32
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh

CHORD = 0.05
"""Chord tolerance (mm) of the grid of the material."""
DEVIATION = 2.5 * CHORD
"""How far the material may reach out of its mesh, mm."""
ROUNDS = 4
"""Times that the mesh is moved out, at most: what is then beyond it was 0.3 mm at most, before 1.1 mm."""


def hull(standing: Float[ndarray, "n 3"], floor: Float[ndarray, "n 3"], faces: Int32[ndarray, "f 3"]) -> TriangleMesh:
    """The mesh through standing vertices that the material leaves by DEVIATION at most, also where it ends in a cliff
    between a vertex that was cut and one that stands: no vertex is lower than its neighbours by more than that."""
    heights = np.linalg.norm(standing - floor, axis=1)
    least = heights.copy()
    for k in range(3):
        one, other = faces[:, k], faces[:, k - 1]
        np.maximum.at(least, one, heights[other] - DEVIATION)
        np.maximum.at(least, other, heights[one] - DEVIATION)
    up = vertex_normals(TriangleMesh(floor, faces))
    return TriangleMesh(standing + (least - heights)[:, None] * up, faces)


def holding(mesh: TriangleMesh, ends: Float[ndarray, "e 3"]) -> TriangleMesh:
    """The mesh, its vertices moved out until it holds the `ends` of what stands, but for DEVIATION: an edge between
    the wall that a level leaves and a face of the stock that stays runs through no vertex."""
    for _ in range(ROUNDS):
        surface = MeshDistance(mesh)
        beyond = ends[surface.unsigned(ends, 2 * DEVIATION) > DEVIATION]
        beyond = beyond[~surface.inside(beyond)]
        if not len(beyond):
            break
        nearest, faces = surface.closest(beyond)
        out = beyond - nearest
        # of the ends beyond the faces round a vertex the farthest moves it
        order = np.argsort(np.linalg.norm(out, axis=1))
        moved = mesh.vertices.copy()
        at = mesh.faces[faces[order]]
        moved[at] = mesh.vertices[at] + out[order][:, None]
        mesh = TriangleMesh(moved, mesh.faces)
    return mesh
