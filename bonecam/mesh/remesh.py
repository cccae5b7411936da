"""Isotropic remeshing: even triangles of one edge length, by MeshLab (Hoppe et al.'s split, collapse, flip, smooth, reproject)."""

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
