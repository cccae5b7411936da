"""The in-process material: what is left of the stock while the levels are machined one after the other, from
the stock inwards.

It is a height field over the parameter domain that all levels share: each place stays where the balls that
swept over it left it, scallops and the fillets of larger balls included. Where a contact was left out it stays
where it was before: an obstacle to shank and holder, and too deep a cut for a ball further in.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.kernels.removal.nails import cut_nails, nail_cells
from bonecam.levels.measure.grid import LevelGrid, level_grid
from bonecam.levels.measure.level import Level, MachinedLevel, RoundedLevel, machined_levels
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock
from bonecam.toolpath.path import Kind, ToolPath

CHORD = 0.05
"""Chord tolerance (mm) of the grid of the material."""
DEVIATION = 2.5 * CHORD
"""How far the material may reach out of its mesh, mm."""
DEPTH_CHORD = 0.005
"""Chord tolerance (mm) of the grid of the places that depths of cut are measured from: about 0.25 mm apart."""
REACH = 1.5
"""A level lowers a place by at most this, mm."""
LEAST_HEIGHT = 1e-4
"""A place that is no higher above the level stays as it is, mm."""
CELL = 0.5
"""Side of the cells that places are found by, mm."""


@dataclass(frozen=True, eq=False)
class Material:
    """The material left: the vertices of `grid` moved to `vertices`, and its closed `mesh`; and places of its
    surface, those of the finer grid `depth_grid` moved to `places`.

    While levels that round the edges of the stock are cut, `mesh` stays the whole stock: the grid cannot
    follow an edge.
    """

    grid: LevelGrid
    vertices: Float[ndarray, "v 3"]
    mesh: TriangleMesh
    depth_grid: LevelGrid
    places: Float[ndarray, "p 3"]

    def thickness(self, level: MachinedLevel, contacts: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Thickness of the material above the level at each contact, mm."""
        floor = self.grid.R @ level.control_points
        thickness = np.linalg.norm(self.vertices - floor, axis=1)
        return np.asarray(thickness[KDTree(floor).query(contacts)[1]])

    def nearest(self, centres: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        """Distance (mm) from each centre of a ball outside to the material, and the place that is nearest."""
        distance, index = KDTree(self.places).query(centres)
        return np.asarray(distance), self.places[index]


def uncut_material(levels: Sequence[Level], stock: Stock) -> Material:
    """The material before the first cut: the stock. `levels` begin at the part and end at the stock."""
    machined = machined_levels(levels)
    nets = [level.control_points for level in machined]
    grid, fine = (level_grid(machined[0].surface, nets, chord) for chord in (CHORD, DEPTH_CHORD))
    vertices, places = (stock.closest_points(each.R @ nets[-1]) for each in (grid, fine))
    return Material(grid, vertices, levels[-1].mesh, fine, places)


def remove_material(material: Material, level: MachinedLevel, path: ToolPath) -> Material:
    """The material after `path` has machined `level`: what its balls reach is gone."""
    vertices = _lowered(material.vertices, material.grid.R @ level.control_points, path)
    places = _lowered(material.places, material.depth_grid.R @ level.control_points, path)
    mesh = material.mesh if isinstance(level, RoundedLevel) else TriangleMesh(vertices, material.grid.faces)
    return replace(material, vertices=vertices, mesh=mesh, places=places)


def _lowered(standing: Float[ndarray, "n 3"], floor: Float[ndarray, "n 3"], path: ToolPath) -> ndarray:
    """Each standing place lowered on the line to its place of the level, as far as the balls cut it."""
    heights = np.linalg.norm(standing - floor, axis=1)
    starts, ends = _cuts(path)
    above = np.flatnonzero(heights > LEAST_HEIGHT)
    if not len(above) or not len(starts):
        return standing
    normals = (standing - floor)[above] / heights[above, None]
    tall = np.minimum(heights[above], REACH)
    feet = standing[above] - tall[:, None] * normals
    order, cell_starts, corner = nail_cells(feet, CELL)
    above, normals, feet, tall = above[order], normals[order], feet[order], tall[order]
    radii = np.full(len(starts), path.cutter.radius)
    names = np.arange(len(starts))
    owners = np.full(len(above), -1)
    cut_nails(feet, normals, cell_starts, corner, CELL, REACH, starts, ends, radii, names, tall, owners)
    lowered = standing.copy()
    lowered[above] = feet + tall[:, None] * normals
    return lowered


def _cuts(path: ToolPath) -> tuple[Float[ndarray, "m 3"], Float[ndarray, "m 3"]]:
    """Where the ball's centre begins and ends each cutting move; a pass begins with one of no length."""
    centres = path.tips + path.cutter.radius * path.axes
    cutting = path.kinds == Kind.CUT
    goes_on = np.r_[False, cutting[:-1] & (path.pass_index[1:] == path.pass_index[:-1])]
    before = np.where(goes_on, np.arange(len(centres)) - 1, np.arange(len(centres)))
    return centres[before[cutting]], centres[cutting]
