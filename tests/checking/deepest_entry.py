"""How deep a tool is in what it must stay out of, by open3d's own distances."""

from functools import lru_cache
from typing import Any

import numpy as np
import open3d as o3d
from numpy import ndarray

from bonecam.mesh import TriangleMesh
from bonecam.tool import Cutter


@lru_cache(maxsize=4)
def rays(mesh: TriangleMesh) -> Any:
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(mesh.vertices.astype(np.float32)), o3d.core.Tensor(mesh.faces.astype(np.uint32))
    )
    return scene


def signed(mesh: TriangleMesh, points: ndarray) -> ndarray:
    scene = rays(mesh)
    found = scene.compute_signed_distance(o3d.core.Tensor(points.astype(np.float32))).numpy().astype(float)
    # one ray may run through an edge: what is said to be inside is asked again by eleven
    inside = np.flatnonzero(found < 0)
    again = o3d.core.Tensor(points[inside].astype(np.float32))
    found[inside] = scene.compute_signed_distance(again, nsamples=11).numpy()
    return found


def deepest_entry(scene: Any, cutter: Cutter, centres: ndarray, axes: ndarray) -> ndarray:
    """Tells how deep (mm) a cutter is in what it must stay out of in a scene, with these ball centres and axes:
    the balls in it about its axis and points of its ends, with open3d's own distances to the meshes. The ball's half
    that cuts is left out."""
    side = np.where(np.abs(axes[:, :1]) < 0.9, np.array([[1.0, 0, 0]]), np.array([[0.0, 1, 0]]))
    x = np.cross(side, axes)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    frames = np.stack([x, np.cross(axes, x), axes], axis=2)
    worst = np.full(len(axes), -np.inf)
    angle = np.arange(24) * (np.pi / 12)
    rim = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    for section in cutter.profile:
        start, end = section.start, section.end
        discs = [f * section.radius * rim + [0, 0, start] for f in (0.2, 0.5, 0.8, 1.0)]
        discs += [section.radius * rim + [0, 0, min(start + f * section.radius, end)] for f in (0.3, 0.6)]
        discs.append(section.end_radius * rim + [0, 0, end])
        count = max(3, int(8 * (end - start) / max(section.radius, section.end_radius)))
        along = np.linspace(start, end, count)
        radius = section.radius + section.taper * (along - start)
        balls = np.minimum(radius / np.hypot(1, section.taper), np.minimum(along - start, end - along))
        points = np.vstack([*discs, along[:, None] * [0, 0, 1.0]]) - [0, 0, cutter.radius]
        thick = np.concatenate([np.zeros(len(discs) * len(rim)), balls])
        placed = (np.einsum("nij,kj->nki", frames, points) + centres[:, None]).reshape(-1, 3)
        around = scene.around(section.name, cutter.radius)
        distance = scene.stock.signed_distance(placed)
        near = distance < np.tile(thick, len(axes)) + 0.5
        distance[near] = signed(around.mesh, placed[near])
        for column in around.columns:
            distance = np.minimum(distance, column.distance(placed))
        if scene.clamping.closed:
            distance = np.minimum(distance, placed[:, 2] - scene.clamping.clearance)
        worst = np.maximum(worst, (thick - distance.reshape(len(axes), -1)).max(axis=1))
    return worst
