"""A mesh that noise makes cut itself in a few faces, smoothed there until it does not."""

import numpy as np

from bonecam.mesh.healing.topology import neighbour_middles
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh

ROUNDS, STEPS = 6, 3
"""Times that a mesh is asked where it cuts itself, and steps after each: vertices move half of the way to the middle
of their neighbours."""
MOST = 0.02
"""Share of the faces above which a mesh that cuts itself is not one with a few tangles."""


def untangled(mesh: TriangleMesh) -> TriangleMesh:
    """The closed mesh with the corners of the faces that cut others, and their neighbours, moved; all other vertices
    stay. Where that does not help, or more than MOST of the faces cut others, the mesh as it is."""
    moved = mesh
    for _ in range(ROUNDS):
        cut = self_intersections(moved)
        if not len(cut):
            return moved
        if len(cut) > MOST * len(mesh.faces):
            break
        corners = np.isin(mesh.faces, mesh.faces[cut]).any(axis=1)
        moving = np.unique(mesh.faces[corners])
        for _ in range(STEPS):
            points = moved.vertices.copy()
            points[moving] += (neighbour_middles(moved)[moving] - points[moving]) / 2
            moved = TriangleMesh(points, mesh.faces)
    return mesh
