"""Exact collision of the tessellated tool with level, material, post and table, by FCL (python-fcl). The only
importer of fcl.

FCL reports surfaces that intersect, never containment; so points of the tool are tested for being inside the
obstacles, and a point of each obstacle for being inside the tool.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import fcl
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths, unit
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.orientation.collision.scene import Scene
from bonecam.orientation.collision.sphere_tracing import TANGENT_SLACK
from bonecam.orientation.collision.tool_mesh import post_mesh, table_mesh, tool_meshes
from bonecam.toolpath.cutter import Cutter

FclObject = Any
"""An fcl.CollisionObject: fcl has no types."""


@dataclass(frozen=True, eq=False)
class FclModel:
    """One cutter in one scene as FCL objects, by section of the tool (cutter, shank, holder).

    While cutting, the cutter is held against the level; else against the material, as the rest of the tool
    is.
    """

    scene: Scene
    cutter: Cutter
    tools: Mapping[str, FclObject]
    cutting_obstacles: Mapping[str, tuple[FclObject, ...]]
    air_obstacles: Mapping[str, tuple[FclObject, ...]]

    def colliding_sections(
        self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], *, cutting: bool = True
    ) -> list[str]:
        """The name of a section of the tool that collides in each pose, or an empty string."""
        obstacles = self.cutting_obstacles if cutting else self.air_obstacles
        tried = [(name, tool, obstacles[name]) for name, tool in self.tools.items()]
        poses = zip(_rotations(axes), tips, strict=True)
        found = [_crossing(fcl.Transform(turn, tip), tried) for turn, tip in poses]

        open_ = np.array([k for k, name in enumerate(found) if not name], dtype=np.int64)
        contained = self._contained_sections(tips[open_], axes[open_], cutting)
        for k, name in zip(open_, contained, strict=True):
            found[k] = name
        return found

    def _contained_sections(
        self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], cutting: bool
    ) -> list[str]:
        """The first section in each pose that lies wholly inside an obstacle, or contains one; an empty string
        where none does."""
        scene = self.scene
        found = np.full(len(tips), "", dtype=object)
        for name, start, end, radius in reversed(self.cutter.sections):
            tangent = cutting and name == "cutter"
            middles = tips + (start + end) / 2 * axes
            distance = scene.level_distance if tangent else scene.material_distance
            post = scene.post if name == "cutter" else scene.post_with_fillet(self.cutter.radius)
            caught = (distance.signed(middles) < 0) | (post.distance(middles) < 0) | (middles[:, 2] < 0)

            mesh = scene.level if tangent else scene.material
            for point in (mesh.vertices[0], np.array([0.0, 0.0, post.top])):
                heights = dots(point - tips, axes)
                away = lengths(point - tips - heights[:, None] * axes)
                caught |= (start < heights) & (heights < end) & (away < radius - TANGENT_SLACK)
            found[caught] = name
        return found.tolist()


def build_fcl_model(scene: Scene, cutter: Cutter, margin: float = 0.0) -> FclModel:
    """The FCL objects of a cutter in a scene; shank and holder are thicker by `margin` (mm)."""
    meshes = tool_meshes(cutter, margin + scene.material_deviation)
    level, material, table = (_object(mesh) for mesh in (scene.level, scene.material, table_mesh()))
    post = _object(post_mesh(scene.post))
    thick_post = _object(post_mesh(scene.post_with_fillet(cutter.radius)))
    others = dict.fromkeys(("shank", "holder"), (material, thick_post, table))
    return FclModel(
        scene,
        cutter,
        tools={name: _object(mesh) for name, mesh in meshes.items()},
        cutting_obstacles={"cutter": (level, post, table), **others},
        air_obstacles={"cutter": (material, post, table), **others},
    )


def _crossing(transform: Any, tried: Sequence[tuple[str, FclObject, tuple[FclObject, ...]]]) -> str:
    """The name of the first section (name, tool, obstacles) whose surface, so placed, crosses that of an
    obstacle, or an empty string."""
    request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
    for name, tool, obstacles in tried:
        tool.setTransform(transform)
        if any(fcl.collide(tool, obstacle, request, fcl.CollisionResult()) for obstacle in obstacles):
            return name
    return ""


def _object(mesh: TriangleMesh) -> FclObject:
    """The mesh as a collision object."""
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(np.array(mesh.vertices), np.array(mesh.faces))
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def _rotations(axes: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
    """Rotations that take +Z to each axis."""
    side = np.eye(3)[np.argmin(np.abs(axes), axis=1)]
    x = unit(np.cross(side, axes))
    return np.stack([x, np.cross(axes, x), axes], axis=2)
