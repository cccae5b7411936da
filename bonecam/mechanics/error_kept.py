"""The error that a place of the finished surface keeps, because part and cutter give way.

At a place p with the outward normal n, cut last by a move with the tool axis a, it is

    -n . (C(p) + c (I - a a^T)) F,

where C is the compliance of what stands behind that path (the softest that it was on it), c that of the cutter, and F
the force on the work while an edge leaves p finished, or, of a body that does not follow single edges, the mean.
Positive: material stays.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.kernels.removal.sweep import Pieces
from bonecam.mechanics.beam import Beam
from bonecam.mechanics.cutter import across
from bonecam.mechanics.edges import EdgeForces
from bonecam.mesh.triangle_mesh import TriangleMesh

UM = 1000.0
"""Micrometres in a millimetre."""
TIP = 0.05
"""Nearer to the ball's tip, as a share of its radius, edges pass a place all the time."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """What gives way: the work as a `beam`, and the cutter by its compliance across its axis (`tool`, mm/N)."""

    beam: Beam
    tool: float

    def compliance(self, points: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
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


@dataclass(eq=False)
class KeptErrors:
    """The error kept at each place of a `finished` surface (`errors`, mm), NaN where no move has cut it; the forces
    there while an edge is `passing` and in the `mean` (N), `axes` and `tool` (mm/N), axis and compliance of the cutter.
    They change while paths are taken."""

    finished: Finished

    def __post_init__(self) -> None:
        count = len(self.finished.points)
        self.errors = np.full(count, np.nan)
        self.passing = np.zeros((count, 3))
        self.mean = np.zeros((count, 3))
        self.axes = np.zeros((count, 3))
        self.tool = np.zeros(count)

    def take(self, pieces: Pieces, edges: EdgeForces, bodies: Bodies, flutes: int, *, follows: bool) -> None:
        """Set the errors of the places that a path has cut last by so many `flutes`; the work `follows` single edges,
        or gives way under the mean force."""
        owners = self.finished.owners
        here = np.flatnonzero(np.isin(owners, np.unique(pieces.moves)))
        if not len(here):
            return
        points = self.finished.points[here]
        piece = piece_through(points, owners[here], pieces)
        self.axes[here] = edges.edges.frames[piece, 2]
        self.tool[here] = bodies.tool
        self.passing[here] = passing_force(points, piece, edges, flutes)
        self.mean[here] = edges.mean[piece]
        self.errors[here] = self.errors_with(bodies.beam, here, follows=follows)

    def errors_with(
        self, beam: Beam, here: Int[ndarray, " k"], *, follows: bool, tool_share: float = 1.0
    ) -> Float[ndarray, " k"]:
        """The errors of some places on a `beam` that `follows` single edges, or gives way under the mean force, and
        with this share of the compliance of the cutters, mm."""
        gives = beam.compliance(self.finished.points[here])
        tool = (tool_share * self.tool[here])[:, None, None] * across(1.0, self.axes[here])
        moved = np.einsum("nij,nj->ni", gives + tool, (self.passing if follows else self.mean)[here])
        return -dots(self.finished.normals[here], moved)


def piece_through(points: Float[ndarray, "n 3"], moves: Int[ndarray, " n"], pieces: Pieces) -> Int[ndarray, " n"]:
    """Of the pieces of the move that cut each point the one whose middle is nearest; pieces are in the order of their
    moves."""
    first = np.searchsorted(pieces.moves, moves, side="left")
    last = np.searchsorted(pieces.moves, moves, side="right")
    middles = (pieces.starts + pieces.ends) / 2
    best = first.copy()
    nearest = np.full(len(points), np.inf)
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
    frames = edges.frames[piece]
    turn = forces.single.shape[1]
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
    return values[order][np.minimum(index, len(values) - 1)]
