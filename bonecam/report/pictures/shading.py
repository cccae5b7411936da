"""Shaded triangles, seen along y."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.report.pictures.panels import Plot
from bonecam.report.pictures.views import corner_normals

LIGHT = np.array([1.0, -2.0, 1.0]) / np.sqrt(6)
"""Direction to the light, seen from -y."""
AMBIENT = 0.55
DIFFUSE = 0.4
"""Brightness of a face that turns away from the light, and what is added where it faces the light."""


def draw_shaded(plot: Plot, mesh: TriangleMesh, side: float, colours: Float[ndarray, "f 3"] | None = None) -> None:
    """Triangles that face the viewer at -y (`side` = 1) or y (-1), the far ones first; grey, or of one colour
    (RGB) a face."""
    from matplotlib.collections import PolyCollection

    facing = np.flatnonzero(side * mesh.face_vectors[:, 1] < 0)
    distance = -side * mesh.vertices[mesh.faces[facing]][:, :, 1].mean(axis=1)
    facing = facing[np.argsort(distance, kind="stable")]
    cosine = np.clip(corner_normals(mesh)[facing] @ (LIGHT * [side, side, 1.0]), 0, 1)
    light = AMBIENT + DIFFUSE * cosine
    corners = mesh.vertices[mesh.faces[facing]][:, :, [0, 2]] * [side, 1]
    shades = light.mean(axis=1, keepdims=True) * (np.ones(3) if colours is None else colours[facing])
    plot.add_collection(PolyCollection(corners, facecolors=shades, edgecolors=shades, linewidths=0.8))
    plot.set_xlabel("x (mm)" if side > 0 else "-x (mm)")
