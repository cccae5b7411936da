"""Remeshing by MeshLab: even triangles of one edge length (Hoppe et al.'s split, collapse, flip, smooth, reproject), or shorter edges."""

import numpy as np

from bonecam.mesh.files import from_meshset, meshlab, to_meshset
from bonecam.mesh.triangle_mesh import TriangleMesh


def remesh(mesh: TriangleMesh, edge: float, *, iterations: int = 8) -> TriangleMesh:
    """A mesh of the same surface with edges near `edge` (mm); its vertices lie on the old surface. ValueError: edge <= 0."""
    if not edge > 0:
        raise ValueError(f"edge {edge} mm: give a positive length")
    meshset = to_meshset(mesh)
    pure = meshlab().PureValue
    meshset.meshing_isotropic_explicit_remeshing(
        iterations=iterations, targetlen=pure(edge), checksurfdist=True, maxsurfdist=pure(edge / 4), featuredeg=60.0
    )
    return from_meshset(meshset)


def split_edges(mesh: TriangleMesh, edge: float) -> TriangleMesh:
    """The same surface with every edge that is longer than `edge` (mm) split in the middle until none is. ValueError: edge <= 0."""
    if not edge > 0:
        raise ValueError(f"edge {edge} mm: give a positive length")
    corners = mesh.vertices[mesh.faces]
    longest = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
    if longest <= edge:
        return mesh
    meshset = to_meshset(mesh)
    halvings = 2 * int(np.ceil(np.log2(longest / edge)))
    meshset.meshing_surface_subdivision_midpoint(iterations=halvings, threshold=meshlab().PureValue(edge))
    return from_meshset(meshset)
