"""The in-process material: what is left of the stock while the levels are machined one after the other, from
the stock inwards.

It is a height field over the parameter domain that all levels share: each vertex of the grid stays where the
last path that cut it left it. Where a contact was left out the vertex stays where it was before: an obstacle
to shank and holder, and too deep a cut for a ball further in.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.levels.measure.grid import LevelGrid, level_grid
from bonecam.levels.measure.level import Level, MachinedLevel, RoundedLevel, machined_levels
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock
from bonecam.toolpath.path import Kind, ToolPath

CHORD = 0.05
"""Chord tolerance (mm) of the grid of the material."""
DEVIATION = 2.5 * CHORD
"""How far the material may reach out of its mesh, mm."""


@dataclass(frozen=True, eq=False)
class Material:
    """The material left: the vertices of `grid` moved to `vertices`, and its closed `mesh`.

    While levels that round the edges of the stock are cut, `mesh` stays the whole stock: the grid cannot
    follow an edge.
    """

    grid: LevelGrid
    vertices: Float[ndarray, "v 3"]
    mesh: TriangleMesh

    def thickness(self, level: MachinedLevel, contacts: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Thickness of the material above the level at each contact, mm."""
        floor = self.grid.R @ level.control_points
        thickness = np.linalg.norm(self.vertices - floor, axis=1)
        return np.asarray(thickness[KDTree(floor).query(contacts)[1]])


def uncut_material(levels: Sequence[Level], stock: Stock) -> Material:
    """The material before the first cut: the stock. `levels` begin at the part and end at the stock."""
    machined = machined_levels(levels)
    grid = level_grid(machined[0].surface, [level.control_points for level in machined], CHORD)
    return Material(grid, stock.closest_points(grid.R @ machined[-1].control_points), levels[-1].mesh)


def remove_material(material: Material, level: MachinedLevel, path: ToolPath) -> Material:
    """The material after `path` has machined `level`: down to the level, or to where the ball was lifted."""
    rows = np.flatnonzero(path.kinds == Kind.CUT)
    if not len(rows):
        return material

    floor = material.grid.R @ level.control_points
    contacts = path.contacts[rows]
    centres = path.tips[rows] + path.cutter.radius * path.axes[rows]

    to_contact, nearest = KDTree(contacts).query(floor)
    outward = centres[nearest] - contacts[nearest]
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    lowered = floor + (1 - path.cutter.radius / length) * outward

    to_uncut = KDTree(path.uncut).query(floor)[0] if len(path.uncut) else np.full(len(floor), np.inf)
    is_cut = np.less_equal(to_contact, to_uncut)
    vertices = np.where(is_cut[:, None], lowered, material.vertices)
    mesh = material.mesh if isinstance(level, RoundedLevel) else TriangleMesh(vertices, material.grid.faces)
    return replace(material, vertices=vertices, mesh=mesh)
