"""The door to pymeshlab: MeshLab's module, and triangle meshes into and out of its mesh sets."""

from functools import cache
from typing import Any

from bonecam.errors import FileError
from bonecam.mesh.triangle_mesh import TriangleMesh


@cache
def meshlab() -> Any:
    """The pymeshlab module; FileError names the system packages to install where its plugins are missing."""
    try:
        import pymeshlab
    except ImportError as error:
        raise FileError(
            f"pymeshlab cannot be loaded ({error}): install the system packages libgl1 and libopengl0"
        ) from error
    if "meshing_isotropic_explicit_remeshing" not in pymeshlab.filter_list():
        count = pymeshlab.plugin_number()
        raise FileError(
            f"pymeshlab loaded only {count} plugins: install the system packages libgl1 and libopengl0",
            plugins=count,
        )
    return pymeshlab


@cache
def meshlab_filters() -> frozenset[str]:
    """The Python names of the filters that this pymeshlab has."""
    return frozenset(meshlab().filter_list())


def to_meshset(mesh: TriangleMesh) -> Any:
    """A pymeshlab.MeshSet with `mesh` as its one layer."""
    meshset = meshlab().MeshSet()
    meshset.add_mesh(meshlab().Mesh(mesh.vertices, mesh.faces))
    return meshset


def from_meshset(meshset: Any) -> TriangleMesh:
    """The current layer of a pymeshlab.MeshSet; ValueError where a face names a vertex that is not there."""
    layer = meshset.current_mesh()
    return TriangleMesh(layer.vertex_matrix(), layer.face_matrix())


def quality_colours(largest: float) -> dict[str, Any]:
    """Parameters of MeshLab's filter that colours vertices by quality: from dark at 0 to light at `largest`."""
    return {"minval": 0.0, "maxval": largest, "colormap": "Viridis"}
