"""The edges of a cutter on the pieces of its moves: where they stand, and how much a tooth takes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths, perpendicular, unit
from bonecam.kernels.removal.engagement import TURN, Edges, over_turns
from bonecam.kernels.removal.sweep import Pieces
from bonecam.material.rays import RayGrid, order
from bonecam.tool.cutter import Cutter

AHEAD = 2.5
"""A piece is asked this many cells ahead of where it begins: closer than that rays do not tell what it cuts from what
the piece before it has left, and forces come out 7 to 12 % low."""
ALONG = 1e-6
"""Below this sine of the angle between feed and axis the feed has no direction across the axis."""
TINY = 1e-12
"""A force whose square is less is none, N^2."""
NO_EDGES = Edges(
    frames=np.empty((0, 3, 3)),
    centres=np.empty((0, 3)),
    feeds=np.empty((0, 2)),
    chips=np.empty(0),
    coefficients=np.zeros(6),
    forces=np.empty((0, TURN, 3), dtype=np.float32),
    engaged=np.empty((0, 5)),
    asked=np.empty(0, dtype=bool),
)
"""Of moves whose forces are not asked."""
NO_EDGES_ASKED = (NO_EDGES,) * 3
"""What the three sets of rays tell of moves whose forces are not asked."""


def edges_on(
    pieces: Pieces, chips: Float[ndarray, " n"], coefficients: Float[ndarray, "6"], cell: float, cutter: Cutter
) -> Edges:
    """The edges of a cutter on pieces of moves in the part's frame, with the feed a tooth of each (`chips`, mm), before
    rays `cell` mm apart are asked."""
    below = cutter.centre_height - cutter.corner
    way = pieces.ends - pieces.starts
    length = lengths(way)
    feed = unit(way)
    axes = unit(pieces.start_axes + pieces.end_axes)
    across = feed - dots(feed, axes)[:, None] * axes
    first = np.where((lengths(across) > ALONG)[:, None], unit(across), perpendicular(axes))
    ahead = np.maximum(AHEAD * cell - length / 2, 0.0)
    count = len(length)
    return Edges(
        frames=np.stack([first, np.cross(axes, first), axes], axis=1),
        centres=(pieces.starts + pieces.ends) / 2 + ahead[:, None] * feed - below * axes,
        feeds=np.column_stack([dots(feed, first), dots(feed, axes)]),
        chips=np.where(length > 0, chips, 0.0),
        coefficients=coefficients,
        forces=np.empty((0, TURN, 3), dtype=np.float32),
        engaged=np.empty((count, 0)),
        asked=np.zeros(count, dtype=bool),
        ring=cutter.radius - cutter.corner,
        corner=cutter.corner,
        below=below,
    )


def edges_in_grid(edges: Edges, grid: RayGrid, direction: int) -> Edges:
    """The edges in the coordinates of the rays along one of the grid's directions, with room for what these tell."""
    columns = order(direction)
    count = len(edges.chips)
    frames = grid.of_vectors(edges.frames.reshape(-1, 3))[:, columns].reshape(-1, 3, 3)
    return edges._replace(
        frames=np.ascontiguousarray(frames),
        centres=np.ascontiguousarray(grid.of_points(edges.centres)[:, columns]),
        forces=np.zeros((count, TURN, 3), dtype=np.float32),
        engaged=np.zeros((count, 5)),
        asked=np.zeros(count, dtype=bool),
    )


@dataclass(frozen=True, eq=False)
class EdgeForces:
    """What all sets of rays tell of the pieces (n,) of a cutter's moves.

    `edges` are those in the part's frame; `single` (n, TURN, 3) is the force of one edge at each place of a turn along
    v, e_r and a (N, float32); `mean` and `peak` (n, 3) that of all flutes over a turn, in the part's frame; `places`
    (n, 3): the mean engaged point; `cut` (n,): some edge is engaged; `areas` (n,): engaged, across the feed, mm^2;
    `spans` (n,): length of the engaged edge, summed over the places of a turn, mm.
    """

    edges: Edges
    single: Float[ndarray, "n t 3"]
    mean: Float[ndarray, "n 3"]
    peak: Float[ndarray, "n 3"]
    places: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    spans: Float[ndarray, " n"]

    @property
    def edge_shares(self) -> Float[ndarray, " n"]:
        """The share of the peak that does not grow with the feed: what an edge presses over its length, in the mean of
        the places of a turn where it cuts, beside the largest force on it; 1 at most."""
        rubbing = float(np.linalg.norm(self.edges.coefficients[3:]))
        squares = np.einsum("ntk,ntk->nt", self.single, self.single)
        length = self.spans / np.maximum((squares > 0).sum(axis=1), 1)
        return np.minimum(rubbing * length / np.sqrt(np.maximum(squares.max(axis=1), TINY)), 1.0)

    @property
    def cut(self) -> ndarray:
        """Whether some edge is engaged on each piece."""
        return self.areas > 0


def forces_of(edges: Edges, asked: Sequence[Edges], flutes: int) -> EdgeForces:
    """The sum of what each set of rays told of the `edges` (`asked`), for a cutter with so many flutes."""
    single = asked[0].forces
    for other in asked[1:]:
        single += other.forces
    engaged = np.sum([each.engaged for each in asked], axis=0)
    mean, peak = np.empty((2, len(single), 3))
    over_turns(single, edges.frames, flutes, mean, peak)
    away = engaged[:, 1:4] / np.maximum(engaged[:, :1], np.finfo(float).tiny)
    points = edges.centres + np.einsum("nk,nkc->nc", away, edges.frames)
    return EdgeForces(edges, single, mean=mean, peak=peak, places=points, areas=engaged[:, 4], spans=engaged[:, 0])
