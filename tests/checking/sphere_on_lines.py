"""A sphere above the table, and lines that a tool comes down on it along."""

import numpy as np

from bonecam.mesh import TriangleMesh
from bonecam.planning import FlatChart

X, Y = np.eye(3)[:2]
RADIUS = 4.0
MIDDLE = 30.0


def sphere(halvings: int = 6) -> TriangleMesh:
    """A sphere of RADIUS about (0, 0, MIDDLE), within 2 um where its edges are halved six times."""
    import igl

    corners = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1]], dtype=float)
    above = np.array([[0, k, k % 4 + 1] for k in (1, 2, 3, 4)])
    below = np.array([[5, k % 4 + 1, k] for k in (1, 2, 3, 4)])
    corners, faces = igl.upsample(corners, np.vstack([above, below]), halvings)
    points = RADIUS * corners / np.linalg.norm(corners, axis=1)[:, None]
    return TriangleMesh(points + MIDDLE * np.eye(3)[2], faces.astype(np.int32))


def flat_chart(cell: float = 0.5) -> FlatChart:
    return FlatChart(-Y, X, np.arange(-6, 6 + cell / 2, cell), np.arange(23, 37 + cell / 2, cell))
