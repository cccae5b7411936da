"""The surface that a program leaves, exact at any places of the part: the balls of its text, and what bending keeps.

Normal probes stand at the places as those of the simulation do (`removal/normal_probes.py`) and are cut by all balls
and flutes of the text; where nothing came near, the height is that of the simulated rays. The error that bending keeps
is that of the nearest triangle of the simulated part.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.machine.machine import Machine
from bonecam.mesh.distance import barycentric, exact_closest
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.motions import Motions
from bonecam.nc.reading.read import read_program
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.verify.removal.groups import groups_of, tools_of
from bonecam.verify.removal.normal_probes import NormalProbes
from bonecam.verify.removal.pieces import straight_pieces
from bonecam.verify.removal.result import Removal


@dataclass(frozen=True, eq=False)
class Machined:
    """Places (n, 3) of the part with outward unit `normals`; how high the surface lies above each as it is cut
    (`cut`, mm) and as it comes out when what was bent springs back (`kept`, mm; the same where bending was not asked);
    `owners`: the move of the text that cut it last, negative where none has."""

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    cut: Float[ndarray, " n"]
    kept: Float[ndarray, " n"]
    owners: Int[ndarray, " n"]


@dataclass(frozen=True, eq=False)
class PostedProgram:
    """A program as text, the machine and the control that run it, its cutters, the part that it makes, and what its
    simulation tells."""

    text: str
    machine: Machine
    dialect: Dialect
    cutters: tuple[Cutter, ...]
    part: TSpline
    removal: Removal

    def motions(self) -> Motions:
        """The moves of the text."""
        return read_program(self.text, self.machine, self.dialect)

    def machined(self, places: Float[ndarray, "n 3"]) -> Machined:
        """The machined surface at the places of the part that are nearest to some `places`, mm."""
        s, t = self.part.project(places).parameters.T
        points, normals = self.part.positions(s, t), self.part.normals(s, t)
        probes = NormalProbes(_NO_MESH, points, normals, np.zeros(len(points)))
        motions = self.motions()
        tools = tools_of(motions, self.cutters)
        for group in groups_of(self.text, motions, self.dialect):
            cutter = tools[group.tool]
            # The pieces with all of their flutes
            pieces = straight_pieces(motions, group.moves, cutter)
            reach = np.full(len(pieces.starts), max(cutter.flute_length - cutter.radius, 0.0))
            probes.cut(pieces._replace(reach=reach), cutter.radius)
        standing = self.removal.remaining
        probes.measure_the_uncut(standing.sets, standing.grid)
        return Machined(points, normals, probes.heights, probes.heights + self._bent(points), probes.owners)

    def _bent(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """The error that bending keeps at places of the part, mm; 0 where that is not known."""
        error = self.removal.mechanics.error if self.removal.mechanics else None
        if error is None:
            return np.zeros(len(points))
        footpoints, faces = exact_closest(error.mesh, points)
        corners = error.mesh.faces[faces]
        weights = barycentric(error.mesh.vertices[corners], footpoints)
        return dots(weights, np.nan_to_num(error.errors)[corners])


_NO_MESH = TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
