"""The loads of a program, path by path while its removal is simulated: force, deflection, stress, and what bends."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import VerifyError
from bonecam.kernels.removal.engagement import Edges
from bonecam.kernels.removal.sweep import Pieces
from bonecam.material.rays import RayGrid
from bonecam.mechanics.cutter import cutter_compliance
from bonecam.mechanics.edges import NO_EDGES, NO_EDGES_ASKED, edges_in_grid, edges_on, forces_of
from bonecam.mechanics.error_kept import Bodies, Finished, KeptErrors
from bonecam.mechanics.workpiece import Standing, Workpiece
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import PARTING

SLOW = 3.0
"""A body whose lowest frequency is less than so many times that of the edges does not follow the force of each edge:
its displacement is that of the mean, within the part that its resonance adds."""


@dataclass(frozen=True, eq=False)
class PathLoads:
    """What one path of a level loads: of its pieces that cut (k,) the `moves`, `minutes`, `mean` and `peak` force (N),
    the `edge_share` of the peak that does not grow with the feed, deflection of part and cutter under the mean
    (`deflection`, mm), and the largest bending stress of what stands below at the peak (`stress`, N/mm^2); the lowest
    frequency (`first_hz`) of what stands behind it, and that of the edges (`tooth_hz`); `rigid`: slices at the upper
    end that are too small to be told of."""

    index: int | None
    rest: int
    moves: Int[ndarray, " k"]
    minutes: Float[ndarray, " k"]
    mean: Float[ndarray, " k"]
    peak: Float[ndarray, " k"]
    edge_share: Float[ndarray, " k"]
    deflection: Float[ndarray, " k"]
    stress: Float[ndarray, " k"]
    first_hz: float
    tooth_hz: float
    rigid: int


class AskedEdges(NamedTuple):
    """The edges of a path in the part's frame, and as each set of rays is asked for them."""

    edges: Edges
    asked: Sequence[Edges]


@dataclass(eq=False)
class Loads:
    """The loads of one program on a `workpiece` (None: nothing is asked); `minutes` and `spindle` (1/min) are those of
    all its moves.

    `paths`, the errors `kept` on the finished surface, and what is `standing` change while paths are taken.
    """

    workpiece: Workpiece | None
    minutes: Float[ndarray, " m"]
    spindle: Float[ndarray, " m"]
    paths: list[PathLoads] = field(default_factory=list)
    kept: KeptErrors | None = None
    standing: Standing | None = None

    def edges(self, pieces: Pieces, grid: RayGrid, cutter: Cutter) -> AskedEdges:
        """The edges of a cutter on pieces of its moves."""
        if self.workpiece is None:
            return AskedEdges(NO_EDGES, NO_EDGES_ASKED)

        # Feed a tooth of the ball's centre, mm; 0 of rapids, and where the spindle stands
        teeth = self._piece_minutes(pieces) * self.spindle[pieces.moves] * cutter.flutes
        way = lengths(pieces.ends - pieces.starts)
        chips = np.where(teeth > 0, way / np.where(teeth > 0, teeth, 1.0), 0.0)

        edges = edges_on(pieces, chips, self.workpiece.force.array, grid.cell, cutter)
        return AskedEdges(edges, [edges_in_grid(edges, grid, direction) for direction in range(3)])

    def take(
        self,
        level: tuple[int | None, int],
        pieces: Pieces,
        edges: AskedEdges,
        cutter: Cutter,
        standing: Standing,
        finished: Finished | None,
    ) -> None:
        """Take the path of a `level` (its index and number of the rest path), whose `edges` have been asked, with what
        stands behind it. VerifyError where that is in pieces, one above the other."""
        work = self.workpiece
        if work is None:
            return
        forces = forces_of(edges.edges, edges.asked, cutter.flutes)
        try:
            bodies = Bodies(work.beam(standing), cutter_compliance(cutter))
        except ValueError as error:
            named = "a path of the program" if level[0] is None else f"the path of level {level[0]}"
            what = f"{named} cuts through the work: {error}"
            raise VerifyError(f"{what}: cut less deep there, or what holds the part less", line=0) from error
        first = bodies.beam.first_frequency(work.stiffness.density)
        tooth = cutter.flutes * float(self.spindle[pieces.moves].max()) / 60
        cut = np.flatnonzero(forces.cut)
        points, mean = forces.places[cut], forces.mean[cut]
        gives = bodies.compliance(points, edges.edges.frames[cut, 2])
        self.paths.append(
            PathLoads(
                index=level[0],
                rest=level[1],
                moves=pieces.moves[cut],
                minutes=self._piece_minutes(pieces)[cut],
                mean=lengths(mean),
                peak=lengths(forces.peak[cut]),
                edge_share=forces.edge_shares[cut],
                deflection=lengths(np.einsum("nij,nj->ni", gives, mean)),
                stress=bodies.beam.moment_stress(forces.peak[cut], points),
                first_hz=np.inf if level[0] == PARTING else first,
                tooth_hz=tooth,
                rigid=bodies.beam.sections.rigid,
            )
        )
        self.standing = standing
        if finished is not None:
            self.kept = self.kept or KeptErrors(finished)
            self.kept.take(pieces, forces, bodies, cutter.flutes, follows=first >= SLOW * tooth)

    def _piece_minutes(self, pieces: Pieces) -> Float[ndarray, " n"]:
        """The time of each piece: its share of that of its move."""
        counts = np.bincount(pieces.moves, minlength=len(self.minutes))
        return self.minutes[pieces.moves] / counts[pieces.moves]
