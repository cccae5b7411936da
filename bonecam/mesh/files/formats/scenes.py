"""GLB and 3MF, by trimesh: scenes of meshes, each put where the scene has it."""

import io
from typing import Any

import numpy as np

from bonecam.mesh.files.formats.content import Content, ContentError

MM_OF_3MF = {
    "micron": 0.001,
    "millimeter": 1.0,
    "centimeter": 10.0,
    "inch": 25.4,
    "foot": 304.8,
    "meter": 1000.0,
}
"""The units of 3MF (Core Specification 1.3, 3.4)."""


def parse_glb(data: bytes) -> Content:
    """The vertices and triangles of a GLB, in its own unit."""
    return _content(_scene(data, "glb"))


def parse_3mf(data: bytes) -> Content:
    """The vertices and triangles of a 3MF, mm."""
    scene = _scene(data, "3mf")
    unit = str(scene.units or "millimeter")
    if unit not in MM_OF_3MF:
        raise ContentError(f"has the unit {unit!r}")
    return _content(scene, MM_OF_3MF[unit])


def _scene(data: bytes, kind: str) -> Any:
    """A trimesh.Scene. ContentError where trimesh, or what it needs for the kind, is not installed, or the bytes are
    none of it: it raises errors of many kinds on damaged ones."""
    needs = f"reading {kind.upper()} needs trimesh", "pip install 'bonecam[formats]'"
    try:
        import trimesh
    except ImportError as error:
        raise ContentError(*needs) from error
    if kind not in trimesh.available_formats():
        raise ContentError(*needs)
    try:
        return trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False)
    except Exception as error:
        reason = " ".join(f"{type(error).__name__} {error}".split())[:200]
        raise ContentError(f"cannot be read as {kind.upper()} ({reason})") from error


def _content(scene: Any, scale: float = 1.0) -> Content:
    if not scene.geometry:
        return Content(np.empty((0, 3)), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    mesh = scene.to_mesh()
    corners = np.asarray(mesh.faces, dtype=np.int64).ravel()
    vertices = scale * np.asarray(mesh.vertices, dtype=np.float64)
    return Content(vertices, corners, np.full(len(corners) // 3, 3, dtype=np.int64))
