"""The material in process: what is left while the levels are machined one after the other, from the stock
inwards.

All levels share one parametrisation, so a place of the grid stays where the last path that cut it left it,
and where a contact was left out it stays whatever was there before: an obstacle to shank and holder, and too
much for a ball further in.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.levels.measure.grid import level_grid
from bonecam.levels.measure.level import Level
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock
from bonecam.toolpath.path import Kind, ToolPath

CHORD = 0.05
DEVIATION = 2.5 * CHORD
"""How far the mesh may lie inside the material, mm."""


class Material:
    """Begins as the stock; `cut` takes away what a path machines. Its mesh stays the whole stock while that
    is rounded: the grid cannot follow an edge.
    """

    def __init__(self, levels: Sequence[Level], stock: Stock) -> None:
        surfaces = [level.surface for level in levels if level.surface is not None]
        nets = [level.net for level in levels if level.surface is not None]
        self._grid = level_grid(surfaces[0], nets, CHORD)
        self._vertices = stock.nearest(self._grid.R @ nets[-1])
        self.mesh: TriangleMesh = levels[-1].mesh

    def over(self, level: Level, contacts: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Thickness of the material on the level at each contact, mm."""
        assert level.surface is not None
        floor = self._grid.R @ level.net
        thickness = np.linalg.norm(self._vertices - floor, axis=1)
        return np.asarray(thickness[KDTree(floor).query(contacts)[1]])

    def cut(self, level: Level, path: ToolPath) -> None:
        """Take away what `path` machines of the material on `level`: down to the level, or to the lifted
        ball."""
        assert level.surface is not None
        floor = self._grid.R @ level.net
        rows = np.flatnonzero(path.kinds == Kind.CUT)
        contacts, centres = path.contacts[rows], path.tips[rows] + path.cutter.radius * path.axes[rows]
        away, nearest = KDTree(contacts).query(floor)
        out = centres[nearest] - contacts[nearest]
        reach = np.linalg.norm(out, axis=1, keepdims=True)
        lowered = floor + (1 - path.cutter.radius / reach) * out
        left = KDTree(path.uncut).query(floor)[0] if len(path.uncut) else np.full(len(floor), np.inf)
        self._vertices = np.where(np.less_equal(away, left)[:, None], lowered, self._vertices)
        if level.within is None:
            self.mesh = TriangleMesh(self._vertices, self._grid.faces)
