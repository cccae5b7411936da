"""The loads of a program, path by path while its removal is simulated: force, deflection, stress, and the error that a
place of the finished surface keeps.

At a place p of the finished surface with the outward normal n, cut last by a move with the tool axis a, the error kept
is

    -n . (C(p) + c (I - a a^T)) F,

where C is the compliance of what stands behind that path (the softest that it was on it), c that of the cutter, and F
the force on the work while an edge passes p; where the lowest frequency of the work is below SLOW times that of the
edges, it does not follow one edge, and F is the mean. Positive: material stays.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.kernels.removal.engagement import Edges
from bonecam.kernels.removal.sweep import Pieces
from bonecam.material.rays import RayGrid
from bonecam.mechanics.beam import Beam
from bonecam.mechanics.cutter import across, cutter_compliance
from bonecam.mechanics.edges import (
    NO_EDGES,
    NO_EDGES_ASKED,
    EdgeForces,
    edges_in_grid,
    edges_on,
    forces_of,
)
from bonecam.mechanics.workpiece import Standing, Workpiece
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import PARTING

SLOW = 3.0
"""A body whose lowest frequency is less than so many times that of the edges does not follow the force of each edge:
its displacement is that of the mean, within the part that its resonance adds."""
TIP = 0.05
"""Nearer to the ball's tip, as a share of its radius, edges pass a place all the time."""


@dataclass(frozen=True, eq=False)
class PathLoads:
    """What one path of a level loads: of its pieces that cut (k,) the `moves`, `minutes`, `mean` and `peak` force (N),
    deflection of part and cutter under the mean (`deflection`, mm), and the largest bending stress of what stands below
    at the peak (`stress`, N/mm^2); the lowest frequency (`first_hz`) of what stands behind it, and that of the edges
    (`tooth_hz`); `rigid`: slices at the upper end that are too small to be told of."""

    index: int | None
    rest: int
    moves: Int[ndarray, " k"]
    minutes: Float[ndarray, " k"]
    mean: Float[ndarray, " k"]
    peak: Float[ndarray, " k"]
    deflection: Float[ndarray, " k"]
    stress: Float[ndarray, " k"]
    first_hz: float
    tooth_hz: float
    rigid: int


@dataclass(frozen=True, eq=False)
class Bodies:
    """What gives way: the work as a `beam`, and the cutter by its compliance across its axis (`tool`, mm/N)."""

    beam: Beam
    tool: float

    def compliance(
        self, points: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]
    ) -> Float[ndarray, "n 3 3"]:
        """Displacement of the work at each point against the cutter with this axis, for a unit force, mm/N."""
        return self.beam.compliance(points) + across(self.tool, axes)


@dataclass(frozen=True, eq=False)
class Finished:
    """Places of the finished surface: vertices of `mesh`, on the exact surface `points` (n, 3) with `normals` and their
    `areas` (mm^2), and the move that cut each last (`owners`, negative where none has)."""

    mesh: TriangleMesh
    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    owners: Int[ndarray, " n"]


class AskedEdges(NamedTuple):
    """The edges of a path in the part's frame, and as each set of rays is asked for them."""

    edges: Edges
    asked: Sequence[Edges]


@dataclass(eq=False)
class Loads:
    """The loads of one program on a `workpiece` (None: nothing is asked); `minutes` and `spindle` (1/min) are those of
    all its moves.

    `paths` and `errors` (the error kept at each place of the finished surface, mm, NaN where no move has cut it) change
    while paths are taken.
    """

    workpiece: Workpiece | None
    minutes: Float[ndarray, " m"]
    spindle: Float[ndarray, " m"]
    paths: list[PathLoads] = field(default_factory=list)
    errors: Float[ndarray, " n"] = field(default_factory=lambda: np.zeros(0))

    def edges(self, pieces: Pieces, grid: RayGrid) -> AskedEdges:
        """The edges on pieces of moves."""
        if self.workpiece is None:
            return AskedEdges(NO_EDGES, NO_EDGES_ASKED)
        chips = self._chips(pieces, self.workpiece.flutes)
        edges = edges_on(pieces, chips, self.workpiece.force.array, grid.cell)
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
        stands behind it."""
        work = self.workpiece
        if work is None:
            return
        forces = forces_of(edges.edges, edges.asked, work.flutes)
        bodies = Bodies(work.beam(standing), cutter_compliance(cutter))
        first = bodies.beam.first_frequency(work.stiffness.density)
        tooth = work.flutes * float(self.spindle[pieces.moves[0]]) / 60
        cut = np.flatnonzero(forces.cut)
        places, mean = forces.places[cut], forces.mean[cut]
        gives = bodies.compliance(places, edges.edges.frames[cut, 2])
        self.paths.append(
            PathLoads(
                index=level[0],
                rest=level[1],
                moves=pieces.moves[cut],
                minutes=self._piece_minutes(pieces)[cut],
                mean=lengths(mean),
                peak=lengths(forces.peak[cut]),
                deflection=lengths(np.einsum("nij,nj->ni", gives, mean)),
                stress=bodies.beam.moment_stress(forces.peak[cut], places),
                first_hz=np.inf if level[0] == PARTING else first,
                tooth_hz=tooth,
                rigid=bodies.beam.sections.rigid,
            )
        )
        if finished is not None:
            flutes = work.flutes if first >= SLOW * tooth else 0
            self._keep_errors(finished, pieces, forces, bodies, flutes)

    def _keep_errors(
        self, finished: Finished, pieces: Pieces, forces: EdgeForces, bodies: Bodies, flutes: int
    ) -> None:
        """Set the errors of the places that the path has cut last, under the force of so many `flutes` while one
        passes, or, for 0, under the mean."""
        if len(self.errors) != len(finished.points):
            self.errors = np.full(len(finished.points), np.nan)
        here = np.flatnonzero(np.isin(finished.owners, np.unique(pieces.moves)))
        if not len(here):
            return
        points = finished.points[here]
        piece = piece_through(points, finished.owners[here], pieces)
        gives = bodies.compliance(points, forces.edges.frames[piece, 2])
        force = passing_force(points, piece, forces, flutes) if flutes else forces.mean[piece]
        self.errors[here] = -dots(finished.normals[here], np.einsum("nij,nj->ni", gives, force))

    def _piece_minutes(self, pieces: Pieces) -> Float[ndarray, " n"]:
        """The time of each piece: its share of that of its move."""
        counts = np.bincount(pieces.moves, minlength=len(self.minutes))
        return np.asarray(self.minutes[pieces.moves] / counts[pieces.moves])

    def _chips(self, pieces: Pieces, flutes: int) -> Float[ndarray, " n"]:
        """Feed a tooth of the ball's centre, mm; 0 of rapids, and where the spindle stands."""
        teeth = self._piece_minutes(pieces) * self.spindle[pieces.moves] * flutes
        way = lengths(pieces.ends - pieces.starts)
        return np.where(teeth > 0, way / np.where(teeth > 0, teeth, 1.0), 0.0)


def piece_through(
    points: Float[ndarray, "n 3"], moves: Int[ndarray, " n"], pieces: Pieces
) -> Int[ndarray, " n"]:
    """Of the pieces of the move that cut each point the one whose middle is nearest; pieces are in the order of their
    moves."""
    first = np.searchsorted(pieces.moves, moves, side="left")
    last = np.searchsorted(pieces.moves, moves, side="right")
    middles = (pieces.starts + pieces.ends) / 2
    best, nearest = first.copy(), np.full(len(points), np.inf)
    for k in range(int((last - first).max())):
        which = np.minimum(first + k, last - 1)
        away = lengths(points - middles[which])
        closer = away < nearest
        best[closer], nearest[closer] = which[closer], away[closer]
    return best


def passing_force(
    points: Float[ndarray, "n 3"], piece: Int[ndarray, " n"], forces: EdgeForces, flutes: int
) -> Float[ndarray, "n 3"]:
    """The force of all flutes on the work while one of them leaves each point finished, N, on the piece that cuts it.

    The ball touches the finished surface where its normal is across the feed; the edge that passes there cuts on the
    side of the feed. At the tip, where edges pass all the time, the force is the mean.
    """
    edges = forces.edges
    frames, turn = edges.frames[piece], forces.single.shape[1]
    away = np.einsum("nkc,nc->nk", frames, points - edges.centres[piece])
    feed = np.insert(edges.feeds[piece], 1, 0.0, axis=1)
    away -= dots(away, feed)[:, None] * feed
    angle = np.arctan2(away[:, 1], away[:, 0])
    at = np.floor(angle / (2 * np.pi) * turn - np.sign(angle) / 2).astype(np.int64)
    total = np.zeros((len(points), 3))
    for flute in range(flutes):
        k = (at + flute * (turn // flutes)) % turn
        phi = (k + 0.5) * 2 * np.pi / turn
        tangential, radial, axial = forces.single[piece, k].astype(float).T
        ahead = radial * np.cos(phi) + tangential * np.sin(phi)
        left = radial * np.sin(phi) - tangential * np.cos(phi)
        total += np.einsum("nk,nkc->nc", np.column_stack([ahead, left, axial]), frames)
    at_tip = np.hypot(away[:, 0], away[:, 1]) < TIP * lengths(away)
    return np.where(at_tip[:, None], forces.mean[piece], total)


def cut_shares(
    values: Float[ndarray, " n"], weights: Float[ndarray, " n"], shares: Sequence[float]
) -> Float[ndarray, " s"]:
    """The values that these shares of the weight stay below or at; zeros where there are none."""
    if not len(values) or not weights.sum() > 0:
        return np.zeros(len(shares))
    order = np.argsort(values)
    up_to = np.cumsum(weights[order])
    index = np.searchsorted(up_to, np.asarray(shares) * up_to[-1], side="left")
    return np.asarray(values[order][np.minimum(index, len(values) - 1)])
