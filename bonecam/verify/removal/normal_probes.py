"""Gouges and leftovers on the part: normal probes on its exact surface, cut by every ball.

A normal probe is a line along the normal (the vector method, Chappel 1983). What is left on it is the height of the
lowest cut, exact to rounding; where no ball came within REACH the material that stands is measured along the probe.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.kernels.removal.body import cut_probes_by_body
from bonecam.kernels.removal.flutes import Ways
from bonecam.kernels.removal.normal_probes import Capsules, ProbesByCell, cut_normal_probes, probe_cells
from bonecam.kernels.removal.rays import RaySet
from bonecam.kernels.removal.sweep import Pieces
from bonecam.material.rays import RayGrid
from bonecam.mechanics.error_kept import Finished
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tspline import TSpline
from bonecam.verify.removal.stock_heights import stock_heights

CHORD = 0.002
"""Chord tolerance, mm, of the tessellation at whose vertices normal probes stand: about 0.15 mm apart on a small
bone."""
REACH = 0.3
"""Cuts up to this height above the surface are exact, mm."""
CELL = 0.5
"""Side of the cells that normal probes are found by, mm."""
NOT_CUT, CUT_BEFORE = -1, -2
"""Owners of a normal probe that no move has cut, and of one that only moves of the program before have."""


@dataclass(eq=False)
class NormalProbes:
    """Normal probes at `points` (n, 3) along unit `normals`, each standing for `areas` (n,) mm^2 of `mesh`'s surface.

    `heights` (mm) and `owners` (the move that cut a probe lowest, NOT_CUT or CUT_BEFORE) change while moves are taken.
    """

    mesh: TriangleMesh
    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    heights: Float[ndarray, " n"] = field(init=False)
    owners: Int[ndarray, " n"] = field(init=False)

    def __post_init__(self) -> None:
        self.by_cell, self.cell_starts, self.corner = probe_cells(self.points, CELL)
        self.heights = np.full(len(self.points), REACH)
        self.owners = np.full(len(self.points), NOT_CUT)

    @property
    def finished(self) -> Finished:
        """The places of the surface as they have been cut; what is told of them changes with further cuts."""
        return Finished(self.mesh, self.points, self.normals, self.areas, self.owners)

    def move(self, pose: Float[ndarray, "4 4"]) -> "NormalProbes":
        """The normal probes under a rigid transform (4, 4), as they have been cut before another program is run."""
        turn = pose[:3, :3].T
        shift = pose[:3, 3]
        moved = NormalProbes(self.mesh.move(pose), self.points @ turn + shift, self.normals @ turn, self.areas)
        cut = self.owners != NOT_CUT
        moved.heights[cut] = self.heights[cut]
        moved.owners[cut] = CUT_BEFORE
        return moved

    def cut(self, pieces: Pieces, radius: float) -> None:
        """Cut the normal probes by a ball on its pieces, and by the flutes above it where they may reach material; or
        by the body of a bull nose."""
        points, normals = self.points[self.by_cell], self.normals[self.by_cell]
        probes = ProbesByCell(points, normals, self.cell_starts, self.corner, CELL)
        heights = self.heights[self.by_cell]
        owners = self.owners[self.by_cell]
        if len(pieces.body):
            poses = pieces.starts, pieces.ends, pieces.start_axes, pieces.end_axes
            ways = Ways(*poses, pieces.reach, pieces.body)
            cut_probes_by_body(probes, REACH, ways, heights, pieces.moves, owners, from_top=False)
        else:
            capsules = _capsules(pieces, radius)
            cut_normal_probes(probes, REACH, capsules, heights, owners, from_top=False)
        self.heights[self.by_cell] = heights
        self.owners[self.by_cell] = owners

    def measure_the_uncut(self, sets: Sequence[RaySet], grid: RayGrid) -> None:
        """Set the heights of normal probes that no ball came near to those of the material that stands on them."""
        uncut = np.flatnonzero(self.owners == NOT_CUT)
        self.heights[uncut] = stock_heights(self.points[uncut], self.normals[uncut], sets, grid)


def normal_probes_on(part: TSpline, chord_tolerance: float = CHORD) -> NormalProbes:
    """Normal probes at the vertices of a fine tessellation, on the exact surface and along its exact normals."""
    tessellation = part.tessellate_with_parameters(chord_tolerance)
    s, t = tessellation.parameters.T
    corners = tessellation.mesh.faces
    thirds = np.linalg.norm(tessellation.mesh.face_vectors, axis=1) / 6
    areas = np.zeros(len(tessellation.mesh.vertices))
    for k in range(3):
        np.add.at(areas, corners[:, k], thirds)
    return NormalProbes(tessellation.mesh, part.positions(s, t), part.normals(s, t), areas)


def _capsules(pieces: Pieces, radius: float) -> Capsules:
    """What a ball sweeps on its pieces, and the flutes above it where they may reach material."""
    fluted = pieces.reach > 0
    # the ball at the top of a capsule must end where the flutes do
    heights = np.maximum(pieces.reach[fluted] - radius, 0.0)
    tops = pieces.ends[fluted] + heights[:, None] * pieces.end_axes[fluted]
    starts = np.vstack([pieces.starts, pieces.ends[fluted]])
    ends = np.vstack([pieces.ends, tops])
    names = np.r_[pieces.moves, pieces.moves[fluted]]
    return Capsules(starts, ends, np.full(len(starts), radius), names)
