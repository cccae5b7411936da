"""Cones of free tool axes as one mesh, to look at."""

import numpy as np

from bonecam.errors import OrientationError
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones.cone import elliptic_cone
from bonecam.tool.path import ToolPath

SIDES = 24
"""Of each cone."""


def cones_mesh(path: ToolPath, count: int = 100, length: float = 3.0) -> TriangleMesh:
    """The cones of `count` evenly chosen contacts at most, each closed and outward: apex at the ball's centre, `length`
    (mm) along its axis. What is drawn lies inside the cone. OrientationError where no contact has a cone."""
    rows = np.flatnonzero(path.cones.cone_of >= 0) if path.cones else np.zeros(0, dtype=np.int64)
    if path.cones is None or not len(rows):
        raise OrientationError(
            f"{path.title}: no contact has a cone: take path.orientation = 'cones', or another level", level=path.level
        )
    some = rows[np.unique(np.linspace(0, len(rows) - 1, min(count, len(rows))).astype(np.int64))]
    cones = [
        elliptic_cone(path.balls[row], path.cones.shapes, int(path.cones.cone_of[row]), length).tessellate(
            SIDES, circumscribed=False
        )
        for row in some
    ]
    starts = np.cumsum([0, *(len(cone.vertices) for cone in cones[:-1])])
    return TriangleMesh(
        np.vstack([cone.vertices for cone in cones]),
        np.vstack([cone.faces + start for cone, start in zip(cones, starts)]).astype(np.int32),
    )
