"""Exact collision of the tessellated tool with level, material, post and clamping, by FCL (python-fcl). The only
importer of fcl.

FCL reports surfaces that intersect, never containment; so points of the tool are tested for being inside the
obstacles, and a point of each obstacle for being inside the tool.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import compress
from typing import Any

import fcl
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots, lengths, rotations_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.collision.scene import Scene, Surroundings
from bonecam.planning.collision.tool_mesh import column_mesh, cutter_mesh, section_mesh, sweep_margin, table_mesh
from bonecam.tool.cutter import Cutter, ToolSection
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.column import Column

FclObject = Any
"""An fcl.CollisionObject: fcl has no types."""


@dataclass(frozen=True, eq=False)
class FclSection:
    """A section of the tool as an FCL object whose origin is at height `at` (mm) above the tip, and those that it must
    stay out of."""

    section: ToolSection
    tool: FclObject
    at: float
    around: Surroundings
    obstacles: tuple[FclObject, ...]


@dataclass(frozen=True, eq=False)
class FclModel:
    """One cutter in one scene while it cuts, as FCL objects."""

    clamping: Clamping
    sections: tuple[FclSection, ...]

    def colliding_sections(
        self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], asked: Bool[ndarray, "n k"] | None = None
    ) -> list[str]:
        """The name of a section of the tool that collides in each pose, or an empty string; of the k sections only
        those are tested that are `asked` for, if it is told."""
        if asked is None:
            asked = np.ones((len(tips), len(self.sections)), dtype=bool)
        poses = zip(rotations_of(axes), tips, asked, strict=True)
        names = [_crossing(turn, tip, compress(self.sections, here)) for turn, tip, here in poses]

        open_ = np.array([k for k, name in enumerate(names) if not name], dtype=np.int64)
        contained = self._contained_sections(tips[open_], axes[open_], asked[open_])
        for k, name in zip(open_, contained, strict=True):
            names[k] = name
        return names

    def _contained_sections(
        self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], asked: Bool[ndarray, "n k"]
    ) -> list[str]:
        """The first section asked for in each pose that lies wholly inside an obstacle, or contains one; an empty
        string where none does."""
        names = np.full(len(tips), "", dtype=object)
        for k, item in reversed(list(enumerate(self.sections))):
            here = np.flatnonzero(asked[:, k])
            names[here[self._contained(item, tips[here], axes[here])]] = item.section.name
        return names.tolist()

    def _contained(
        self, item: FclSection, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]
    ) -> Bool[ndarray, " n"]:
        """Whether a section lies wholly inside an obstacle in each pose, or contains one."""
        section, around = item.section, item.around
        middles = tips + (section.start + section.end) / 2 * axes
        caught = around.mesh_distance.signed(middles) < 0
        if self.clamping.closed:
            caught |= middles[:, 2] < self.clamping.clearance
        points = [around.mesh.vertices[0]]
        for column in around.columns:
            caught |= column.distance(middles) < 0
            points.append(np.array([column.x, column.y, column.top]))

        for point in points:
            heights = dots(point - tips, axes)
            away = lengths(point - tips - heights[:, None] * axes)
            radius = section.radius + section.taper * (heights - section.start)
            within = (section.start < heights) & (heights < section.end)
            caught |= within & (away < radius - around.scene.tangent_slack)
        return np.asarray(caught)


@lru_cache(maxsize=2)
def build_fcl_model(scene: Scene, cutter: Cutter, margin: float = 0.0) -> FclModel:
    """The FCL objects of a cutter in a scene; above the cutter the tool is thicker by `sweep_margin`s of `margin`
    (mm). Those made last, of one with and of one without a margin, are kept: the rest paths of a level have one scene,
    of which they take .1 to .3 s each."""
    meshes = {"level": obstacle_object(scene.level), "material": obstacle_object(scene.material)}
    table = (fcl_object(table_mesh(scene.clamping.clearance)),) if scene.clamping.closed else ()
    columns: dict[Column, FclObject] = {}
    sections = []
    for section in cutter.profile:
        around = scene.around(section.name, cutter.envelope_radius)
        by = sweep_margin(cutter, section, margin) + scene.material_deviation
        tool, at = _section_object(cutter, section, by, scene.tangent_slack)
        for column in around.columns:
            columns.setdefault(column, fcl_object(column_mesh(column)))
        standing = [columns[column] for column in around.columns]
        obstacles = (meshes[around.obstacle], *standing, *table)
        sections.append(FclSection(section, tool, at, around, obstacles))
    return FclModel(scene.clamping, tuple(sections))


def _section_object(cutter: Cutter, section: ToolSection, by: float, slack: float) -> tuple[FclObject, float]:
    """A section, thicker by `by` (mm) above the cutter, which is thinner by `slack` (mm), and its origin's height above
    the tip (mm). FCL answers for a cylinder twice as fast as for a mesh of one."""
    if section.name == "cutter":
        return fcl_object(cutter_mesh(cutter, slack)), 0.0
    if section.taper:
        return fcl_object(section_mesh(section, by)), 0.0
    cylinder = fcl.Cylinder(section.radius + by, section.end - section.start + 2 * by)
    return fcl.CollisionObject(cylinder, fcl.Transform()), (section.start + section.end) / 2


def _crossing(turn: Float[ndarray, "3 3"], tip: Float[ndarray, "3"], sections: Iterable[FclSection]) -> str:
    """The name of the first section whose surface, so placed, crosses that of an obstacle, or an empty
    string."""
    for item in sections:
        item.tool.setTransform(fcl.Transform(turn, tip + item.at * turn[:, 2]))
        if any(_cross(item.tool, other) for other in item.obstacles):
            return item.section.name
    return ""


def fcl_object(mesh: TriangleMesh) -> FclObject:
    """The mesh as a collision object."""
    return solid_object(np.array(mesh.vertices), np.array(mesh.faces))


@lru_cache(maxsize=4)
def obstacle_object(mesh: TriangleMesh) -> FclObject:
    """The mesh as an object that stays where it is: cones and poses are asked for in one scene, whose meshes take .04 s
    each."""
    return fcl_object(mesh)


def solid_object(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> FclObject:
    """Vertices and faces as a collision object."""
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices, faces)
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def crosses(solid: FclObject, turned: Float[ndarray, "3 3"], at: Float[ndarray, "3"], other: FclObject) -> bool:
    """Whether the surface of an object, turned and moved there, crosses that of another."""
    solid.setTransform(fcl.Transform(turned, at))
    return _cross(solid, other)


def distance_of(solid: FclObject, turned: Float[ndarray, "3 3"], at: Float[ndarray, "3"], other: FclObject) -> float:
    """The distance (mm) of the surface of an object, turned and moved there, from that of another; 0 where they
    cross."""
    solid.setTransform(fcl.Transform(turned, at))
    return max(float(fcl.distance(solid, other, fcl.DistanceRequest(), fcl.DistanceResult())), 0.0)


def _cross(one: FclObject, other: FclObject) -> bool:
    """Whether the surfaces of two objects cross."""
    request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
    return bool(fcl.collide(one, other, request, fcl.CollisionResult()))
