"""Nested grids of distances to a closed mesh, fine near it and coarse far from it."""

import numpy as np

from bonecam.errors import OrientationError
from bonecam.kernels.closest.distance_grids import Grids, flood
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh

GRIDS = ((0.4, 3.0), (1.2, 14.0), (4.0, 60.0))
"""Sides of the cells and how far the grids reach out from the mesh, mm; of larger parts in proportion."""
USUAL_SIZE = 40.0
"""Diagonal (mm) of the box of meshes up to which GRIDS hold: a quarter of a million nodes."""


def distance_grids(distance: MeshDistance) -> Grids:
    """The grids of a mesh; OrientationError where it is not closed: what is inside of it cannot be told."""
    mesh = distance.mesh
    require_closed(mesh)
    low, high = mesh.bounds
    scale = max(1.0, mesh.diagonal / USUAL_SIZE)
    steps, origins, counts, values = [], [], [], []
    for side, reach in GRIDS:
        step = side * scale
        origin = low - max(reach, 2 * step)
        shape = np.ceil((high - low + 2 * max(reach, 2 * step)) / step).astype(np.int64) + 1
        nodes = origin + step * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
        far = distance.unsigned(nodes.reshape(-1, 3)).reshape(shape)
        steps.append(step)
        origins.append(origin)
        counts.append(shape)
        values.append(flood(far, step).ravel())
    starts = np.cumsum([0] + [len(part) for part in values[:-1]])
    return Grids(
        np.array(steps), np.array(origins), np.array(counts), starts, np.concatenate(values), low, high
    )


def require_closed(mesh: TriangleMesh) -> None:
    """OrientationError where an edge of the mesh has not two faces."""
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    if (counts % 2).any():
        open_ = int((counts % 2 == 1).sum())
        raise OrientationError(
            f"an obstacle is not closed: {open_} edges have a face on one side only: close it first",
            edges=open_,
        )
