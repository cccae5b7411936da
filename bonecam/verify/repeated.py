"""Distances to a body and its copies at every pitch about the Z axis, from the mesh of one of them."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance


@dataclass(frozen=True, eq=False)
class RepeatedDistance:
    """Distances to the union of `count` copies of a body, which is measured once and turned back to."""

    body: MeshDistance
    count: int

    def signed(self, points: Float[ndarray, "n 3"], wanted: float | Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """A lower bound of the signed distance (negative inside) of each point, mm; exact outside where it is below
        `wanted`."""
        least = np.array(np.broadcast_to(np.asarray(wanted, dtype=np.float64), len(points)))
        x, y, z = points.T
        for angle in 2 * np.pi * np.arange(self.count) / self.count:
            back = np.column_stack([x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle), z])
            least = np.minimum(least, self.body.signed(back, least))
        return np.asarray(least)
