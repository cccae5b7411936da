"""The union of closed meshes as one closed mesh, and the difference of two, exact (Zhou et al. 2016)."""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh.healing.topology import edges_of
from bonecam.mesh.triangle_mesh import TriangleMesh, side_by_side


def solid_union(meshes: Sequence[TriangleMesh], names: Sequence[str] = ()) -> TriangleMesh:
    """The boundary of everything that lies in one of the closed, outward meshes; it may have several pieces.

    MeshError, with the name of the mesh (`names`, or its number), where one is not closed or encloses no volume.
    """
    called = names or [f"solid {number}" for number in range(len(meshes))]
    for mesh, name in zip(meshes, called, strict=True):
        _require_solid(mesh, name)
    both = side_by_side(meshes)
    return _boolean("union", both.vertices, both.faces.astype(np.int64))


def solid_difference(one: TriangleMesh, other: TriangleMesh) -> TriangleMesh:
    """The boundary of what lies in the first closed mesh and not in the second; MeshError as in `solid_union`."""
    for mesh, name in ((one, "the first solid"), (other, "the second solid")):
        _require_solid(mesh, name)
    faces = one.faces.astype(np.int64), other.faces.astype(np.int64)
    return _boolean("minus", one.vertices, faces[0], other.vertices, faces[1])


def _boolean(name: str, *arrays: ndarray) -> TriangleMesh:
    """The result of one of libigl's operations on meshes."""
    import igl.copyleft.cgal as cgal

    try:
        points, corners, _ = cgal.mesh_boolean(*arrays, type_str=name)
    except RuntimeError as error:
        raise MeshError(f"the solids cannot be combined ({error}): repair them first") from error
    return TriangleMesh(points, np.asarray(corners, dtype=np.int32))


def _require_solid(mesh: TriangleMesh, name: str) -> None:
    """MeshError where a mesh is open or faces inward."""
    edges, counts = edges_of(mesh)
    if not len(mesh.faces) or (counts % 2).any():
        open_at = mesh.vertices[edges[np.argmax(counts % 2)]].mean(axis=0) if len(mesh.faces) else np.zeros(3)
        place = ", ".join(f"{x:.2f}" for x in open_at)
        raise MeshError(
            f"{name} is not closed near ({place}): close it, as the filter meshing_close_holes does",
            name=name,
            place=open_at,
        )
    if not mesh.volume > 0:
        raise MeshError(f"{name} encloses {mesh.volume:.3g} mm^3: turn its faces outward", name=name)
