"""Closed meshes of the tool, the post and the table, for collision tests between meshes."""

import numpy as np

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.orientation.collision.sphere_tracing import TANGENT_SLACK
from bonecam.setup.holding import Post
from bonecam.toolpath.cutter import Cutter

SIDES = 48
"""Sides of the polygons that stand for circles."""
TABLE_HALF_WIDTH = 2000.0
"""Half of the width, depth and height of the table, mm."""


def tool_meshes(cutter: Cutter, margin: float = 0.0) -> dict[str, TriangleMesh]:
    """Closed meshes of cutter, shank and holder with the tip at the origin and the axis along +Z.

    The cutter is thinner by TANGENT_SLACK; shank and holder contain their true shapes, thicker by `margin`
    (mm).
    """
    ball, shank, holder = cutter.sections
    angle = np.linspace(0, np.pi / 2, 9)[1:]
    thin = cutter.radius - TANGENT_SLACK
    rings = [(cutter.radius - thin * float(np.cos(a)), thin * float(np.sin(a))) for a in angle]
    meshes = {"cutter": solid_of_revolution([*rings, (ball[2], thin)], cutter.radius - thin)}
    circumscribed = 1 / np.cos(np.pi / SIDES)
    for name, start, end, radius in (shank, holder):
        wide = (radius + margin) * circumscribed
        meshes[name] = solid_of_revolution([(start - margin, wide), (end + margin, wide)], start - margin)
    return meshes


def solid_of_revolution(rings: list[tuple[float, float]], bottom: float) -> TriangleMesh:
    """The closed mesh through circles (height, radius) about +Z, with a point at height `bottom` below the
    first and one in the middle of the last."""
    angle = np.arange(SIDES) * (2 * np.pi / SIDES)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)])
    bottom_point = np.array([[0.0, 0.0, bottom]])
    top_point = np.array([[0.0, 0.0, rings[-1][0]]])
    circles = [radius * circle + [0.0, 0.0, height] for height, radius in rings]

    here = np.arange(SIDES)
    there = np.roll(here, -1)
    faces = [np.column_stack([np.zeros(SIDES, int), 1 + there, 1 + here])]
    for k in range(len(rings) - 1):
        lower = 1 + k * SIDES
        upper = lower + SIDES
        faces.append(np.column_stack([lower + here, lower + there, upper + there]))
        faces.append(np.column_stack([lower + here, upper + there, upper + here]))
    last = 1 + (len(rings) - 1) * SIDES
    faces.append(np.column_stack([last + here, last + there, np.full(SIDES, last + SIDES)]))
    return TriangleMesh(np.vstack([bottom_point, *circles, top_point]), np.vstack(faces).astype(np.int32))


def post_mesh(post: Post) -> TriangleMesh:
    """A prism about the post, from the table up to its top."""
    wide = post.radius / np.cos(np.pi / SIDES)
    return solid_of_revolution([(0.0, wide), (post.top, wide)], 0.0)


def table_mesh() -> TriangleMesh:
    """A block below z = 0."""
    w = TABLE_HALF_WIDTH
    corners = np.array([[x, y, z] for z in (-w, 0.0) for x, y in ((-w, -w), (w, -w), (w, w), (-w, w))])
    quads = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    triangles = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return TriangleMesh(corners, np.array(triangles, dtype=np.int32))
