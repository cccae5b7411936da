"""Exact collision of the tessellated tool with level, material, post and clamping, by FCL (python-fcl). The only
importer of fcl.

FCL reports surfaces that intersect, never containment; so points of the tool are tested for being inside the
obstacles, and a point of each obstacle for being inside the tool.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import fcl
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import dots, lengths, rotations_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.orientation.collision.scene import Scene, Surroundings
from bonecam.orientation.collision.sphere_tracing import TANGENT_SLACK
from bonecam.orientation.collision.tool_mesh import (
    column_mesh,
    cutter_mesh,
    section_mesh,
    sweep_margin,
    table_mesh,
)
from bonecam.setup.fixture.clamping import Clamping
from bonecam.setup.fixture.column import Column
from bonecam.toolpath.cutters.cutter import Cutter, Section

FclObject = Any
"""An fcl.CollisionObject: fcl has no types."""


@dataclass(frozen=True, eq=False)
class FclSection:
    """A section of the tool as an FCL object, and those that it must stay out of."""

    section: Section
    tool: FclObject
    around: Surroundings
    obstacles: tuple[FclObject, ...]


@dataclass(frozen=True, eq=False)
class FclModel:
    """One cutter in one scene while it cuts, as FCL objects."""

    clamping: Clamping
    sections: tuple[FclSection, ...]

    def colliding_sections(self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> list[str]:
        """The name of a section of the tool that collides in each pose, or an empty string."""
        poses = zip(rotations_of(axes), tips, strict=True)
        found = [_crossing(fcl.Transform(turn, tip), self.sections) for turn, tip in poses]

        open_ = np.array([k for k, name in enumerate(found) if not name], dtype=np.int64)
        contained = self._contained_sections(tips[open_], axes[open_])
        for k, name in zip(open_, contained, strict=True):
            found[k] = name
        return found

    def _contained_sections(self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> list[str]:
        """The first section in each pose that lies wholly inside an obstacle, or contains one; an empty string
        where none does."""
        found = np.full(len(tips), "", dtype=object)
        for item in reversed(self.sections):
            section, around = item.section, item.around
            middles = tips + (section.start + section.end) / 2 * axes
            caught = around.mesh_distance.signed(middles) < 0
            if self.clamping.closed:
                caught |= middles[:, 2] < self.clamping.clearance
            points = [around.mesh.vertices[0]]
            for column in around.columns:
                caught |= column.distance(middles) < 0
                points.append(np.array([0.0, 0.0, column.top]))

            for point in points:
                heights = dots(point - tips, axes)
                away = lengths(point - tips - heights[:, None] * axes)
                radius = section.radius + section.taper * (heights - section.start)
                within = (section.start < heights) & (heights < section.end)
                caught |= within & (away < radius - TANGENT_SLACK)
            found[caught] = section.name
        return found.tolist()


def build_fcl_model(scene: Scene, cutter: Cutter, margin: float = 0.0) -> FclModel:
    """The FCL objects of a cutter in a scene; above the cutter the tool is thicker by `sweep_margin`s of `margin`
    (mm)."""
    meshes = {"level": fcl_object(scene.level), "material": fcl_object(scene.material)}
    table = (fcl_object(table_mesh(scene.clamping.clearance)),) if scene.clamping.closed else ()
    columns: dict[Column, FclObject] = {}
    sections = []
    for section in cutter.profile:
        around = scene.around(section.name, cutter.radius)
        by = sweep_margin(cutter, section, margin) + scene.material_deviation
        tool = cutter_mesh(cutter) if section.name == "cutter" else section_mesh(section, by)
        for column in around.columns:
            columns.setdefault(column, fcl_object(column_mesh(column)))
        standing = [columns[column] for column in around.columns]
        obstacles = (meshes[around.obstacle], *standing, *table)
        sections.append(FclSection(section, fcl_object(tool), around, obstacles))
    return FclModel(scene.clamping, tuple(sections))


def _crossing(transform: Any, sections: Sequence[FclSection]) -> str:
    """The name of the first section whose surface, so placed, crosses that of an obstacle, or an empty
    string."""
    for item in sections:
        item.tool.setTransform(transform)
        if any(_cross(item.tool, other) for other in item.obstacles):
            return item.section.name
    return ""


def fcl_object(mesh: TriangleMesh) -> FclObject:
    """The mesh as a collision object."""
    return solid_object(np.array(mesh.vertices), np.array(mesh.faces))


def solid_object(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> FclObject:
    """Vertices and faces as a collision object."""
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices, faces)
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def crosses(
    solid: FclObject, turned: Float[ndarray, "3 3"], at: Float[ndarray, "3"], other: FclObject
) -> bool:
    """Whether the surface of an object, turned and moved there, crosses that of another."""
    solid.setTransform(fcl.Transform(turned, at))
    return _cross(solid, other)


def _cross(one: FclObject, other: FclObject) -> bool:
    """Whether the surfaces of two objects cross."""
    request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
    return bool(fcl.collide(one, other, request, fcl.CollisionResult()))
