"""Exact collision of the tessellated tool with level, material, post and table, by FCL (python-fcl). The only
importer of fcl.

FCL reports surfaces that intersect, never containment; so points of the tool are tested for being inside the
obstacles, and a point of each obstacle for being inside the tool.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import fcl
import numpy as np
from jaxtyping import Float
from numpy import ndarray

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

    def colliding_section(
        self, tip: Float[ndarray, "3"], axis: Float[ndarray, "3"], *, cutting: bool = True
    ) -> str:
        """The name of the first section of the tool that collides, or an empty string."""
        transform = fcl.Transform(_rotation(axis), tip)
        request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
        obstacles = self.cutting_obstacles if cutting else self.air_obstacles
        for name, tool in self.tools.items():
            tool.setTransform(transform)
            if any(fcl.collide(tool, o, request, fcl.CollisionResult()) for o in obstacles[name]):
                return name
        return _contained_section(self.scene, self.cutter, tip, axis, cutting)


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


def _contained_section(
    scene: Scene, cutter: Cutter, tip: Float[ndarray, "3"], axis: Float[ndarray, "3"], cutting: bool
) -> str:
    """The first section that lies wholly inside an obstacle, or contains one; an empty string where none
    does."""
    for name, start, end, radius in cutter.sections:
        tangent = cutting and name == "cutter"
        middle = (tip + (start + end) / 2 * axis)[None]
        distance = scene.level_distance if tangent else scene.material_distance
        post = scene.post if name == "cutter" else scene.post_with_fillet(cutter.radius)
        if distance.signed(middle)[0] < 0 or post.distance(middle)[0] < 0 or middle[0, 2] < 0:
            return name

        mesh = scene.level if tangent else scene.material
        for point in (mesh.vertices[0], np.array([0.0, 0.0, post.top])):
            height = (point - tip) @ axis
            away = np.linalg.norm(point - tip - height * axis)
            if start < height < end and away < radius - TANGENT_SLACK:
                return name
    return ""


def _object(mesh: TriangleMesh) -> FclObject:
    """The mesh as a collision object."""
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(np.array(mesh.vertices), np.array(mesh.faces))
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def _rotation(axis: Float[ndarray, "3"]) -> Float[ndarray, "3 3"]:
    """A rotation that takes +Z to `axis`."""
    side = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(side, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])
