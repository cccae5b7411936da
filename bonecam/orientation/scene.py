"""What stands round the tool while one level is machined: the level, the material still on it, the post and the table.

The cutter may touch the level (what must remain); shank and holder may not touch the material, which is everything inside
the level before. The post is thicker for shank and holder, because the ball leaves a fillet of its radius round it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.stock import Capsule
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.toolpath.post import Post

TABLE_CLEARANCE = 0.5
FAR = 1.0
"""The stock's own distance serves where it exceeds what is asked by this much, mm: it is the cheaper lower bound."""


@dataclass(frozen=True, eq=False)
class Scene:
    """`level` must remain; `material` (closed, inside `stock`) is there while the level is cut; the table is z = 0.

    `material_deviation` (mm) is how far the material may reach out of its mesh.
    """

    level: TriangleMesh
    material: TriangleMesh
    stock: Capsule
    post: Post
    material_deviation: float = 0.0

    @cached_property
    def level_distance(self) -> MeshDistance:
        """Distances to what must remain."""
        return MeshDistance(self.level)

    @cached_property
    def material_distance(self) -> MeshDistance:
        """Distances to the material in process."""
        return MeshDistance(self.material)

    def thick_post(self, radius: float) -> Post:
        """The post with the fillet a ball of `radius` leaves round it."""
        return Post(self.post.radius + radius, self.post.top)

    def room(self, points: Float[ndarray, "n 3"], wanted: Float[ndarray, " n"], against: str, post: Post) -> Float[ndarray, " n"]:
        """A lower bound of the signed distance to `against` (`level` or `material`) and the post, mm.

        It is exact where it is below `wanted` + FAR.
        """
        distance = self.stock.signed_distance(points)
        close = np.flatnonzero(distance < wanted + FAR)
        if len(close) and against == "level":
            distance[close] = self.level_distance.signed(points[close], wanted[close] + FAR)
        elif len(close):
            deviation = self.material_deviation
            distance[close] = self.material_distance.signed(points[close], wanted[close] + FAR + deviation) - deviation
        return np.minimum(distance, post.distance(points))
