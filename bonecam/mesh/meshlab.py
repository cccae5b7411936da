"""The door to pymeshlab: MeshLab's module, and triangle meshes into and out of its mesh sets."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from bonecam.errors import FileError
from bonecam.files import library_name
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, silent
from bonecam.runtime.loading import loaded_once


@loaded_once
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
            f"pymeshlab loaded only {count} plugins: install the system packages libgl1 and libopengl0", plugins=count
        )
    return pymeshlab


@cache
def meshlab_filters() -> frozenset[str]:
    """The Python names of the filters that this pymeshlab has."""
    return frozenset(meshlab().filter_list())


@cache
def meshlab_refusals() -> tuple[type[Exception], ...]:
    """What pymeshlab raises where it takes no value or a filter fails: its own kinds of exception, of which only one is
    a PyMeshLabException, and those of pybind11."""
    own = (kind for kind in vars(meshlab().pmeshlab).values() if isinstance(kind, type))
    return (*(kind for kind in own if issubclass(kind, Exception)), RuntimeError, TypeError, ValueError)


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


def write_layers(file: str, folder: str, options: Mapping[str, Any], progress: Progress = silent) -> dict[str, str]:
    """Write the layers that MeshLab reads from a file, by `options` of its reader, into a folder; their labels by
    the names of the files.

    FileError where MeshLab refuses the file. A damaged one may end the process.
    """
    meshset = meshlab().MeshSet()
    try:
        with library_name(file) as name:
            meshset.load_new_mesh(name, **options)
    except meshlab().PyMeshLabException as error:
        reason = " ".join(str(error).split()).rstrip(":")
        raise FileError(f"{file}: {reason}: give a readable mesh file", file=file) from error
    labels = {}
    for k, layer in enumerate(meshset):
        meshset.set_current_mesh(layer.id())
        lines = layer.edge_number() > 0 and layer.face_number() == 0
        name = f"{k}.obj" if lines else f"{k}.ply"
        meshset.save_current_mesh(str(Path(folder) / name), **({} if lines else {"save_vertex_normal": True}))
        labels[name] = layer.label()
    return labels


def call_on_cube(file: str, method: str, values: Mapping[str, Any], progress: Progress = silent) -> None:
    """Call a method of a pymeshlab.MeshSet, with a cube in it, that reads or writes `file`. FileError where MeshLab
    refuses it; it may end the process."""
    meshset = meshlab().MeshSet()
    meshset.create_cube()
    try:
        getattr(meshset, method)(**values)
    except meshlab().PyMeshLabException as error:
        reason = " ".join(str(error).split()).rstrip(":")
        raise FileError(f"{file}: {reason}: give a readable file", file=file) from error
