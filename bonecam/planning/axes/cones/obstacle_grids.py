"""Nested grids of distances to a closed mesh, fine near it and coarse far from it."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import OrientationError
from bonecam.kernels.closest.distance_grids import Grids, distance_bounds, flood
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.healing.topology import edges_of
from bonecam.mesh.triangle_mesh import TriangleMesh

GRIDS = ((0.4, 3.0, 2.0, 0.0), (1.2, 14.0, 14.0, 0.02), (4.0, 60.0, np.inf, 0.01))
"""Sides of the cells, how far the grids reach out from the mesh and from the box of the ball centres, mm, and by which
share their distances may be too small; sides grow with the size of grids, and with the root of a radius above 1."""
USUAL_SIZE = 65.0
"""Diagonal (mm) of what a grid is about, up to which GRIDS hold: a quarter of a million nodes."""


def distance_grids(distance: MeshDistance, radius: float, far: float, centres: Float[ndarray, "n 3"]) -> Grids:
    """The grids of a mesh for tools of a `radius` that reach `far` out of it (mm) with their balls at `centres`: fine
    ones only where the tools are, since a bound of interpolated distances is low by the square of the cells.

    OrientationError where the mesh is not closed: what is inside of it cannot be told.
    """
    mesh = distance.mesh
    require_closed(mesh)
    needed = [grid for grid, nearer in zip(GRIDS, [0.0, *(reach for _, reach, *_ in GRIDS)]) if nearer < far]
    low, high = mesh.bounds
    grids = Grids(np.array([[0.0, *low, *high, 0.0]]), np.zeros(0))
    for side, reach, beside, slack in reversed(needed):
        near = beside if len(grids.values) else np.inf
        first = np.maximum(low, centres.min(axis=0) - near)
        last = np.maximum(np.minimum(high, centres.max(axis=0) + near), first)
        # a tool is free where the distance exceeds its radius, and there interpolation errs by 3 h^2 / (8 radius)
        step = side * max(1.0, float(np.linalg.norm(last - first)) / USUAL_SIZE) * max(1.0, radius**0.5)
        origin = first - max(reach, 2 * step)
        shape = np.ceil((last - first + 2 * max(reach, 2 * step)) / step).astype(np.int64) + 1
        nodes = (origin + step * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)).reshape(-1, 3)
        apart = distance.lower_bound(nodes, slack).reshape(shape)
        off = ((nodes < low) | (nodes > high)).any(axis=1)
        values = flood(apart, step, off | (distance_bounds(grids, nodes) > 0)).ravel()
        grids.cells[:-1, 7] += len(values)
        row = [step, *origin, *shape, 0.0]
        grids = Grids(np.vstack([row, grids.cells]), np.concatenate([values, grids.values]))
    return grids


def require_closed(mesh: TriangleMesh) -> None:
    """OrientationError where an edge of the mesh has not two faces."""
    _, counts = edges_of(mesh)
    if (counts % 2).any():
        open_ = int((counts % 2 == 1).sum())
        raise OrientationError(
            f"an obstacle is not closed: {open_} edges have a face on one side only: close it first", edges=open_
        )
