"""Closed meshes of the tool, the post and the table, for collision tests between meshes."""

import numpy as np

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.orientation.collision.sphere_tracing import TANGENT_SLACK
from bonecam.setup.holding import Post
from bonecam.setup.revolution import revolve
from bonecam.toolpath.cutter import Cutter

SIDES = 48
"""Sides of the polygons that stand for circles."""
CIRCUMSCRIBED = 1 / np.cos(np.pi / SIDES)
"""Radius of the corners of a polygon of SIDES that contains the circle of radius 1."""
BALL_RINGS = 8
"""Rings of vertices that stand for the half ball of the cutter."""
TABLE_HALF_WIDTH = 2000.0
"""Half of the width, depth and height of the table, mm."""


def tool_meshes(cutter: Cutter, margin: float = 0.0) -> dict[str, TriangleMesh]:
    """Closed meshes of cutter, shank and holder with the tip at the origin and the axis along +Z.

    The cutter is thinner by TANGENT_SLACK; shank and holder contain their true shapes, thicker by `margin`
    (mm).
    """
    ball, shank, holder = cutter.sections
    angle = np.linspace(0, np.pi / 2, BALL_RINGS + 1)[1:]
    thin = cutter.radius - TANGENT_SLACK
    radii = np.append(thin * np.sin(angle), thin)
    heights = np.append(cutter.radius - thin * np.cos(angle), ball[2])
    meshes = {"cutter": revolve(radii, heights, (cutter.radius - thin, ball[2]), SIDES)}
    for name, start, end, radius in (shank, holder):
        meshes[name] = _prism((radius + margin) * CIRCUMSCRIBED, start - margin, end + margin)
    return meshes


def post_mesh(post: Post) -> TriangleMesh:
    """A prism about the post, from the table up to its top."""
    return _prism(post.radius * CIRCUMSCRIBED, 0.0, post.top)


def _prism(radius: float, bottom: float, top: float) -> TriangleMesh:
    """An upright prism whose SIDES corners lie on a circle of `radius` about the Z axis, mm."""
    return revolve(np.full(2, radius), np.array([bottom, top]), (bottom, top), SIDES)


def table_mesh() -> TriangleMesh:
    """A block below z = 0."""
    w = TABLE_HALF_WIDTH
    corners = np.array([[x, y, z] for z in (-w, 0.0) for x, y in ((-w, -w), (w, -w), (w, w), (-w, w))])
    quads = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    triangles = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return TriangleMesh(corners, np.array(triangles, dtype=np.int32))
