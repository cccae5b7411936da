"""Stage 1: triangle meshes: files, units, repair, harmonic rows, distances. Public names load when first
used."""

from importlib import import_module
from typing import Any

_HOMES = {
    "TriangleMesh": "triangle_mesh",
    "read_mesh": "files.mesh_files",
    "write_mesh": "files.mesh_files",
    "to_mm": "units",
    "repair": "healing.repair",
    "faults_of": "healing.faults",
    "upright": "pose",
    "remesh": "remeshing",
    "harmonic_rows": "sections.rows",
    "Rows": "sections.rows",
    "MeshDistance": "distance",
    "exact_closest": "distance",
    "self_intersections": "intersections",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'bonecam.mesh' has no attribute {name!r}")
    return getattr(import_module(f"bonecam.mesh.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
