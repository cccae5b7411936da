"""The obstacles while one level is machined: the level, the material still on it, the post, and the clamping.

The cutter may touch the level (what must remain) and the post; shank, holder and spindle may not touch the
material, which is everything inside the level before. The post is thicker for them, because the ball leaves a
fillet of its radius round it. The whole tool keeps the clearance from table and chuck, holder and spindle from
the post too. What holds the free end is kept out of as the post is.

The mesh that a cutter is held against on a level, and how deep its flutes may go into that: no gouge of the part.

The ball is kept out of level and part alike. The flutes are held against the level alone, whose mesh is coarser than
the part's: an outer level that comes within microns of the part there is held as the part itself is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.distances import column_bound
from bonecam.levels.measure import Level, MachinedLevel, morph_surfaces
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.contacts import MESH_SHARE, flute_slack, planned_tolerance
from bonecam.setup.capsule import Capsule
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.post import Column, Post

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
        if self.core is not None and section == "shank":
            kept[0] = self.post.column.grown(reserve)
        elif self.core is not None and tangent:
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


PART_CHORD = 0.002
"""Largest chord tolerance (mm) of the tessellated part that balls are kept out of: MESH_SHARE of the gouge
tolerance by default."""
LEVEL_CHORD = 0.01
"""Chord tolerance (mm) of the other tessellated levels: a ball that enters one of them leaves the part
alone."""
BETWEEN = 0.002
"""How much nearer to the part a level may be between the vertices of its mesh than at them, mm."""


def part_chord(gouge_tolerance: float) -> float:
    """The chord tolerance (mm) of the part's mesh where a gouge of `gouge_tolerance` mm is allowed."""
    return min(PART_CHORD, MESH_SHARE * planned_tolerance(gouge_tolerance))


def distance_to_part(levels: Sequence[Level], gouge_tolerance: float) -> MeshDistance:
    """Distances to the part, that of the `levels` from part to stock, tessellated as finely as the gouge tolerance (mm)
    asks for."""
    return MeshDistance(morph_surfaces(levels)[0].tessellate(part_chord(gouge_tolerance)))


def held_level(level: MachinedLevel, part: MeshDistance, gouge_tolerance: float) -> tuple[MeshDistance, float]:
    """Distances to the mesh of a `level`, and how deep (mm) flutes may go into it (`Scene.tangent_slack`) so that they
    go into the `part`, whose mesh has `part_chord`, by `flute_slack` at most."""
    slack = flute_slack(gouge_tolerance)
    if not level.index:
        return part, slack
    coarse = MeshDistance(level.surface.tessellate(LEVEL_CHORD))
    reach = TANGENT_SLACK - slack + BETWEEN
    if part.unsigned(coarse.mesh.vertices).min() >= reach:
        return coarse, TANGENT_SLACK
    return MeshDistance(level.surface.tessellate(part_chord(gouge_tolerance))), slack
