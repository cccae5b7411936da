"""A shell for the second clamping: a cylinder about the Z axis with the form of the finished end in it.

For trying, and for printing: where the part is wider inside than at the opening, print it in two halves.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.solids.booleans import solid_difference
from bonecam.mesh.solids.revolution import cylinder
from bonecam.mesh.triangle_mesh import TriangleMesh

CHORD = 0.05
"""Chord tolerance of the cylinder, mm."""


def shell_round(part: TriangleMesh, covered: float, wall: float, gap: float) -> TriangleMesh:
    """The shell round the upper end of a standing part, its opening down.

    `covered` is the share of the part's height in it, `wall` (mm) its least thickness, `gap` (mm) what it keeps from
    the part. ValueError where these make no shell.
    """
    if not (0 < covered < 1 and wall > 0 and gap >= 0):
        raise ValueError(
            f"covered = {covered:g}, wall = {wall:g}, gap = {gap:g}: give a share between 0 and 1, a positive wall "
            "and no negative gap"
        )
    low, high = part.bounds[:, 2]
    opening = float(high - covered * (high - low))
    inside = _grown(part, gap)
    held = inside.vertices[inside.vertices[:, 2] > opening]
    radius = float(np.hypot(held[:, 0], held[:, 1]).max()) + wall
    block = cylinder(radius, opening, float(high) + gap + wall, CHORD)
    return solid_difference(block, inside)


def _grown(part: TriangleMesh, gap: float) -> TriangleMesh:
    """The part with its vertices moved out along their normals."""
    moved: Float[ndarray, "n 3"] = part.vertices + gap * vertex_normals(part)
    return TriangleMesh(moved, part.faces)
