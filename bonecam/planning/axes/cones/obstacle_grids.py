"""Nested grids of distances to a closed mesh, fine near it and coarse far from it."""

import numpy as np

from bonecam.errors import OrientationError
from bonecam.kernels.closest.distance_grids import Grids, flood
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh

GRIDS = ((0.4, 3.0, 0.0), (1.2, 14.0, 0.02), (4.0, 60.0, 0.01))
"""Sides of the cells and how far the grids reach out from the mesh, mm, and by which share their distances may be too
small; sides grow with the size of parts, and with the root of a radius above 1."""
USUAL_SIZE = 40.0
"""Diagonal (mm) of the box of meshes up to which GRIDS hold: a quarter of a million nodes."""


def distance_grids(distance: MeshDistance, radius: float, far: float) -> Grids:
    """The grids of a mesh for tools of a `radius` that reach `far` out of it, mm.

    OrientationError where the mesh is not closed: what is inside of it cannot be told.
    """
    mesh = distance.mesh
    require_closed(mesh)
    low, high = mesh.bounds
    # a tool is free where the distance exceeds its radius, and there interpolation errs by 3 h^2 / (8 radius)
    scale = max(1.0, mesh.diagonal / USUAL_SIZE) * max(1.0, np.sqrt(radius))
    needed = [grid for grid, (_, nearer, _) in zip(GRIDS, [(0.0, 0.0, 0.0), *GRIDS]) if nearer < far]
    steps, origins, counts, values = [], [], [], []
    for side, reach, slack in needed:
        step = side * scale
        origin = low - max(reach, 2 * step)
        shape = np.ceil((high - low + 2 * max(reach, 2 * step)) / step).astype(np.int64) + 1
        nodes = origin + step * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
        apart = distance.lower_bound(nodes.reshape(-1, 3), slack).reshape(shape)
        steps.append(step)
        origins.append(origin)
        counts.append(shape)
        values.append(flood(apart, step).ravel())
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
