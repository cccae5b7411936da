"""Boxes as meshes."""

import numpy as np

from bonecam.mesh import TriangleMesh

BOX = np.array([[int(k) for k in face] for face in "021 123 456 576 014 154 263 367 042 246 135 375".split()])
"""Corners of the triangles of a box, outward."""


def boxes(*bounds: tuple[list[float], list[float]]) -> TriangleMesh:
    """Boxes between pairs of corners, as one mesh."""
    corners = [
        [x, y, z]
        for low, high in bounds
        for x in (low[0], high[0])
        for y in (low[1], high[1])
        for z in (low[2], high[2])
    ]
    faces = np.vstack([BOX + 8 * k for k in range(len(bounds))])
    return TriangleMesh(np.array(corners), faces.astype(np.int32))
