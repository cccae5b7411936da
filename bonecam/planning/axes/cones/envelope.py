"""What a section of the tool sweeps for all axes of an elliptic cone: a closed mesh that holds it.

A section is a cylinder of radius r between the heights h and H above the apex, which may lie anywhere within `growth`
of its place. For all axes of the cone its points x (from the place of the apex) have

    n . x <= r + growth             for the outward normals n of the planes tangent to the cone,
    |x| <= |(H, r)| + growth,
    x . a >= h - growth             for an axis a of the cone.

The mesh has these planes as its sides. Its upper facets are no nearer than the bound, and so far away that they meet
each edge between two sides above its lower end, also of a section that is wide and short; its lower vertices, and so
its lower facets, lie in the convex set of all x for which the last line holds for no a.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.kernels.closest.swept_bounds import swept_hold
from bonecam.kernels.closest.swept_cones import swept_vertices
from bonecam.mesh.solids.revolution import ring_faces

STAIRS = ((1.0, 3**-0.5), ((2 / 3) ** 0.5, (2 / 3) ** 0.5), (3**-0.5, 1.0))
"""How far the steps that hold a quarter of the unit disc reach out and down."""


@dataclass(frozen=True)
class Sweep:
    """What a cylinder from `start` to `end` above the apex sweeps for all axes of a cone with the semi-angles `first`
    and `second` (radians, less than a right one) and apexes within `growth` of its place; mm."""

    start: float
    end: float
    radius: float
    first: float
    second: float
    growth: float

    @property
    def sizes(self) -> Float[ndarray, "6"]:
        """All of it in the order of the fields, as the kernels take it."""
        return np.array([self.start, self.end, self.radius, self.first, self.second, self.growth])

    def mesh(self, sides: int) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]] | None:
        """Vertices and outward faces of a mesh that holds it, of `sides` sides, the apex in the origin, the cone's axis
        along Z, and its largest opening along X; None where there is none (`swept_vertices`)."""
        vertices = swept_vertices(self.sizes, sides)
        return (vertices, _faces((len(vertices) - 2) // sides, sides)) if len(vertices) else None

    def steps(self) -> tuple["Sweep", ...]:
        """Sweeps that hold it together, and less below: growth rounds the edge of the section there, which they follow
        as a stair."""
        sweeps = []
        for out, down in STAIRS:
            start, radius = self.start - down * self.growth, self.radius + out * self.growth
            sweeps.append(
                Sweep(
                    start,
                    self.end + self.growth,
                    radius=radius,
                    first=self.first,
                    second=self.second,
                    growth=0.0,
                )
            )
        return tuple(sweeps)

    def holds(self, points: Float[ndarray, "n 3"], sides: int) -> Bool[ndarray, " n"]:
        """Which points, in the frame of the mesh, lie within the bounds that it has."""
        sizes = np.tile(self.sizes, (len(points), 1))
        return swept_hold(sizes, sides, np.ascontiguousarray(points))


@lru_cache(maxsize=64)
def _faces(rings: int, sides: int) -> Int[ndarray, "f 3"]:
    return ring_faces(rings, sides)
