"""What stands round the tool while one level is machined: the level, the material still on it, the post and
the table.

The cutter may touch the level (what must remain); shank and holder may not touch the material, which is
everything inside the level before. The post is thicker for shank and holder, because the ball leaves a fillet
of its radius round it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.holding import Post
from bonecam.setup.stock import Capsule

TABLE_CLEARANCE = 0.5
FAR = 1.0
"""The stock's own distance serves where it exceeds what is asked by this much, mm: it is the cheaper lower
bound."""


@dataclass(frozen=True, eq=False)
class Scene:
    """`level` must remain; `material` (closed, inside `stock`) is there while the level is cut; the table is
    z = 0.

    `material_deviation` (mm) is how far the material may reach out of its mesh; `known` measures the level's
    distances already.
    """

    level: TriangleMesh
    material: TriangleMesh
    stock: Capsule
    post: Post
    material_deviation: float = 0.0
    known: MeshDistance | None = None

    @cached_property
    def level_distance(self) -> MeshDistance:
        """Distances to what must remain."""
        return self.known or MeshDistance(self.level)

    @cached_property
    def material_distance(self) -> MeshDistance:
        """Distances to the material in process."""
        return MeshDistance(self.material)

    def thick_post(self, radius: float) -> Post:
        """The post with the fillet a ball of `radius` leaves round it."""
        return Post(self.post.radius + radius, self.post.top)

    def room(
        self,
        points: Float[ndarray, "n 3"],
        wanted: Float[ndarray, " n"],
        against: str,
        post: Post,
        *,
        outside: bool = False,
    ) -> Float[ndarray, " n"]:
        """A lower bound of the signed distance to `against` (`level` or `material`) and the post, mm.

        It is exact where it is below `wanted` + FAR. `outside`: no point is inside `against`, which saves
        asking.
        """
        distance = self.stock.signed_distance(points)
        close = np.flatnonzero(distance < wanted + FAR)
        if len(close):
            mesh, deviation = (
                (self.level_distance, 0.0)
                if against == "level"
                else (self.material_distance, self.material_deviation)
            )
            ask = mesh.unsigned if outside else mesh.signed
            distance[close] = ask(points[close], wanted[close] + FAR + deviation) - deviation
        return np.minimum(distance, post.distance(points))
