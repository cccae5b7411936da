"""The obstacles while one level is machined: the level, the material still on it, the post and the table.

The cutter may touch the level (what must remain); shank and holder may not touch the material, which is
everything inside the level before. The post is thicker for shank and holder, because the ball leaves a fillet
of its radius round it. The table is z = 0.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.capsule import Capsule
from bonecam.setup.holding import Post

TABLE_CLEARANCE = 0.5
"""Shank and holder keep this far above the table, mm."""
FAR = 1.0
"""The distance to the stock serves where it exceeds what is asked by this much, mm: it is the cheaper lower
bound."""

Obstacle = Literal["level", "material"]


@dataclass(frozen=True, eq=False)
class Scene:
    """`level` must remain; `material` (closed, inside `stock`) is there while the level is cut; the `post`
    holds the part.

    `material_deviation` (mm) is how far the material may reach out of its mesh. `known_level_distance` saves
    building the distances to `level` again. `part_distance`: the ball must stay out of the part as well, whose
    mesh is finer: a level may touch it.
    """

    level: TriangleMesh
    material: TriangleMesh
    stock: Capsule
    post: Post
    material_deviation: float = 0.0
    known_level_distance: MeshDistance | None = None
    part_distance: MeshDistance | None = None

    @cached_property
    def level_distance(self) -> MeshDistance:
        """Distances to the level."""
        return self.known_level_distance or MeshDistance(self.level)

    @property
    def remaining(self) -> tuple[MeshDistance, ...]:
        """Distances to what the ball must not enter."""
        part = self.part_distance
        return (self.level_distance,) if part is None else (self.level_distance, part)

    @cached_property
    def material_distance(self) -> MeshDistance:
        """Distances to the mesh of the material."""
        return MeshDistance(self.material)

    def post_with_fillet(self, radius: float) -> Post:
        """The post with the fillet that a ball of `radius` (mm) leaves round it."""
        return Post(self.post.radius + radius, self.post.top)

    def distance_bound(
        self,
        points: Float[ndarray, "n 3"],
        wanted: Float[ndarray, " n"],
        obstacle: Obstacle,
        post: Post,
        *,
        outside: bool = False,
    ) -> Float[ndarray, " n"]:
        """A lower bound of the signed distance to the obstacle and the post, mm; exact where it is below
        `wanted` + FAR.

        `outside`: no point is inside the obstacle, which makes the answer quicker.
        """
        distance = self.stock.signed_distance(points)
        close = np.flatnonzero(distance < wanted + FAR)
        if len(close):
            mesh = self.level_distance if obstacle == "level" else self.material_distance
            deviation = 0.0 if obstacle == "level" else self.material_deviation
            may_be_inside = (distance[close] < FAR) & (not outside)
            limits = wanted[close] + FAR + deviation
            distance[close] = mesh.signed(points[close], limits, may_be_inside) - deviation
        return np.minimum(distance, post.distance(points))
