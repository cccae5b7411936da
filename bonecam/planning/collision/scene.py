"""The obstacles while one level is machined: the level, the material still on it, the post, and the clamping.

The cutter may touch the level (what must remain) and the post; shank, holder and spindle may not touch the
material, which is everything inside the level before. The post is thicker for them, because the ball leaves a
fillet of its radius round it. The whole tool keeps the clearance from table and chuck, holder and spindle from
the post too. What holds the free end is kept out of as the post is.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.closest.columns import column_bound
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.capsule import Capsule
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.column import Column
from bonecam.workholding.post import Post

FAR = 1.0
"""The distance to the stock serves where it exceeds what is asked by this much, mm: it is the cheaper lower
bound."""

TANGENT_SLACK = 0.01
"""The cutter is thinner by this much (mm) against a level whose mesh deviates by as much: a tangent contact is no
collision."""

PIN_GAP = 0.05
"""The cutter keeps so far from what holds the free end, mm: half of what its ball keeps from it, as from the post."""

Obstacle = Literal["level", "material"]


@dataclass(frozen=True, eq=False)
class Scene:
    """`level` must remain; `material` (closed, inside `stock`) is there while the level is cut; the `post`
    holds the part, the `clamping` the post.

    `material_deviation` (mm) is how far the material may reach out of its mesh. `known_level_distance` saves
    building the distances to `level` again. `part_distance`: the ball must stay out of the part as well, whose
    mesh is finer: a level may touch it. `core`: what of the post stays where it is cut itself; the cutter keeps out of
    that alone while it cuts. `tangent_slack` (mm): so much thinner the cutter is held against the level; its flutes
    may go so deep into it.
    """

    level: TriangleMesh
    material: TriangleMesh
    stock: Capsule
    post: Post
    material_deviation: float = 0.0
    known_level_distance: MeshDistance | None = None
    part_distance: MeshDistance | None = None
    clamping: Clamping = field(default_factory=Clamping)
    core: Post | None = None
    tangent_slack: float = TANGENT_SLACK

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
        return self.level_distance if self.material is self.level else MeshDistance(self.material)

    def around(self, section: str, ball_radius: float, air: float | None = None) -> "Surroundings":
        """What a section of the tool (cutter, shank, holder, spindle) stays out of.

        `air` (mm) is what the tool keeps from material and post while it moves between passes; None while it
        cuts: the cutter is then held against the level, and touches it.
        """
        reserve = air or 0.0
        tangent = air is None and section == "cutter"
        kept = [self._kept(solid, section, ball_radius, reserve) for solid in self.post.solids]
        if tangent and self.core is not None:
            kept[0] = self.core.column
        obstacle: Obstacle = "level" if tangent else "material"
        return Surroundings(self, obstacle, reserve, (*kept, *self.clamping.kept_columns(section, reserve)))

    def _kept(self, solid: Column, section: str, ball_radius: float, reserve: float) -> Column:
        """The post, or what holds the free end, as a section of the tool keeps out of it with a `reserve` (mm): the
        ball leaves a fillet of its radius round it."""
        if section == "cutter":
            return solid.grown(max(reserve, PIN_GAP if solid is self.post.pin else 0.0))
        if section == "shank":
            return replace(solid, radius=solid.radius + ball_radius).grown(reserve)
        by = max(reserve, self.clamping.clearance)
        return replace(solid.grown(by), radius=solid.radius + max(by, ball_radius + reserve))


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A mesh of the `scene` that is kept off by `reserve` mm, and columns."""

    scene: Scene
    obstacle: Obstacle
    reserve: float
    columns: tuple[Column, ...]

    @property
    def mesh(self) -> TriangleMesh:
        """The mesh."""
        return self.scene.level if self.obstacle == "level" else self.scene.material

    @property
    def mesh_distance(self) -> MeshDistance:
        """Distances to the mesh."""
        return self.scene.level_distance if self.obstacle == "level" else self.scene.material_distance

    @property
    def deviation(self) -> float:
        """How far the obstacle may reach out of its mesh, mm."""
        return 0.0 if self.obstacle == "level" else self.scene.material_deviation

    def distance_bound(
        self, points: Float[ndarray, "n 3"], wanted: Float[ndarray, " n"], *, outside: bool = False
    ) -> Float[ndarray, " n"]:
        """A lower bound of the signed distance to the columns and to what is within the reserve of the mesh, mm;
        exact where it is below `wanted` + FAR.

        `outside`: no point is inside the obstacle, which makes the answer quicker.
        """
        distance = self.scene.stock.signed_distance(points) - self.reserve
        close = np.flatnonzero(distance < wanted + FAR)
        if len(close):
            off = self.deviation + self.reserve
            may_be_inside = (distance[close] + self.reserve < FAR) & (not outside)
            limits = wanted[close] + FAR + off
            distance[close] = self.mesh_distance.signed(points[close], limits, may_be_inside) - off
        if self.columns:
            rows = np.array([column.row for column in self.columns])
            column_bound(np.require(points, requirements=["C", "W"]), rows, distance)
        return distance
