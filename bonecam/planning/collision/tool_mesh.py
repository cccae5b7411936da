"""Closed meshes of the tool, of columns and of the table, for collision tests between meshes."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.solids.revolution import revolve
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.tool.cutter import Cutter, ToolSection
from bonecam.workholding.column import Column

SIDES = 48
"""Sides of the polygons that stand for circles."""
CIRCUMSCRIBED = 1 / np.cos(np.pi / SIDES)
"""Radius of the corners of a polygon of SIDES that contains the circle of radius 1."""
BALL_RINGS = 8
"""Rings of vertices that stand for the half ball of the cutter."""
TABLE_HALF_WIDTH = 2000.0
"""Half of the width, depth and height of the table, mm."""


def sweep_margin(cutter: Cutter, section: ToolSection, margin: float) -> float:
    """How far (mm) a section moves where no point of the tool up to the gauge line moves further than
    `margin` (mm); a turn moves the spindle behind it further."""
    return margin * max(1.0, farthest(section) / reach_to_gauge_line(cutter))


def reach_to_gauge_line(cutter: Cutter) -> float:
    """The largest distance of a point of the tool below the spindle from the tip, mm."""
    return max(farthest(section) for section in cutter.profile if section.name != "spindle")


def farthest(section: ToolSection) -> float:
    """The largest distance of a point of the section from the tip, mm."""
    return float(np.hypot(section.end, section.widest))


def cutter_mesh(cutter: Cutter, slack: float) -> TriangleMesh:
    """The closed mesh of ball, bull nose or flat end and flutes with the tip at the origin and the axis along +Z,
    thinner by `slack`, mm."""
    end = cutter.profile[0].end
    corner = max(cutter.corner, slack)
    ring = cutter.radius - corner
    thin = corner - slack
    angle = np.linspace(0, np.pi / 2, BALL_RINGS + 1)[1:] if thin else np.array([np.pi / 2])
    radii = np.append(thin * np.sin(angle), thin) + ring
    heights = np.append(corner - thin * np.cos(angle), end)
    return revolve(radii, heights, (slack, end), SIDES)


def section_mesh(section: ToolSection, margin: float = 0.0) -> TriangleMesh:
    """The closed mesh that holds a section with the tip at the origin and the axis along +Z, thicker by `margin`
    (mm)."""
    across = margin * np.hypot(1.0, section.taper)
    radii = np.array([section.radius, section.radius, section.end_radius, section.end_radius]) + across
    heights = np.array([section.start - margin, section.start, section.end, section.end + margin])
    if not section.taper:
        radii, heights = radii[[0, -1]], heights[[0, -1]]
    return revolve(radii * CIRCUMSCRIBED, heights, (heights[0], heights[-1]), SIDES)


def column_mesh(column: Column) -> TriangleMesh:
    """A prism about a column; an endless one ends far below the table."""
    bottom = max(column.bottom, -TABLE_HALF_WIDTH)
    radius = np.full(2, column.radius * CIRCUMSCRIBED)
    prism = revolve(radius, np.array([bottom, column.top]), (bottom, column.top), SIDES)
    return TriangleMesh(prism.vertices + np.array([column.x, column.y, 0.0]), prism.faces)


def table_mesh(top: float) -> TriangleMesh:
    """A block below z = `top`, mm."""
    w = TABLE_HALF_WIDTH
    return block_mesh(np.array([[-w, -w, -w], [w, w, top]]))


def block_mesh(bounds: Float[ndarray, "2 3"]) -> TriangleMesh:
    """A block between its lowest and highest corner, mm."""
    (x0, y0, z0), (x1, y1, z1) = bounds
    corners = np.array([[x, y, z] for z in (z0, z1) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))])
    quads = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    triangles = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return TriangleMesh(corners, np.array(triangles, dtype=np.int32))
