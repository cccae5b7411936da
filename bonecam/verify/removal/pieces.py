"""The moves read from a text as straight pieces of the ball centre's path."""

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.kernels.removal.sweep import Pieces
from bonecam.nc.reading.motions import Motions
from bonecam.toolpath.cutter import Cutter
from bonecam.verify.gouge import centre_bows
from bonecam.verify.removal.rays import RayGrid, order

STRAIGHT = 0.001
"""The path of the ball's centre deviates from its pieces by this at most, mm."""
MOST_TURN = np.radians(2.0)
"""The axis turns by this at most on a piece: the way it takes then differs from a great circle by less than
0.01 mm at the end of a holder 60 mm away."""


def straight_pieces(motions: Motions, moves: Int[ndarray, " m"], cutter: Cutter) -> Pieces:
    """The pieces of consecutive moves of one cutter, in the part's frame.

    Of a move whose start is unknown (after a retract to the end of the machine's travel) only its end is one.
    """
    control = motions.controls[cutter.number]
    end = motions.words[moves]
    known = motions.known_start[moves]
    before = motions.words[np.maximum(moves - 1, 0)]
    start = np.where(known[:, None], before, end)
    bows = np.where(known, centre_bows(control, start, end), 0.0)
    _, first_axes = control.poses(start)
    _, last_axes = control.poses(end)
    turns = np.abs(end[:, 3:] - start[:, 3:]).sum(1) / MOST_TURN
    turns = np.where(angles_between(first_axes, last_axes) > 0, turns, 1.0)
    counts = np.ceil(np.maximum(np.sqrt(bows / 8 / STRAIGHT), turns)).astype(np.int64).clip(1)

    owner = np.repeat(np.arange(len(moves)), counts)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    tips, axes = control.between(start[owner], end[owner], place / counts[owner])
    end_tips, end_axes = control.between(start[owner], end[owner], (place + 1) / counts[owner])
    return Pieces(
        tips + cutter.radius * axes,
        end_tips + cutter.radius * end_axes,
        axes,
        end_axes,
        moves[owner],
        np.zeros(len(owner)),
        np.full((len(owner), 2), np.inf),
        np.zeros((len(owner), 2, 2)),
    )


def in_grid(pieces: Pieces, grid: RayGrid, direction: int) -> Pieces:
    """The pieces in the coordinates of the rays along one of the grid's directions."""
    columns = order(direction)
    return pieces._replace(
        starts=np.ascontiguousarray(grid.of_points(pieces.starts)[:, columns]),
        ends=np.ascontiguousarray(grid.of_points(pieces.ends)[:, columns]),
        start_axes=np.ascontiguousarray(grid.of_vectors(pieces.start_axes)[:, columns]),
        end_axes=np.ascontiguousarray(grid.of_vectors(pieces.end_axes)[:, columns]),
    )
