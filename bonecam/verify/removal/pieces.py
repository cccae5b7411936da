"""The moves read from a text as straight pieces of the ball centre's path."""

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from bonecam.arrays import angles_between, numbered
from bonecam.kernels.removal.sweep import Pieces
from bonecam.material.rays import RayGrid, order
from bonecam.nc.reading.motions import Motions
from bonecam.tool.cutter import Cutter
from bonecam.verify.gouge import centre_bows

STRAIGHT = 0.001
"""The path of the ball's centre deviates from its pieces by this at most, mm."""
SWAY = 0.02
"""The far end of the holder is at most so far (mm) from where it would be if the axis turned along great
circles between the ends of a piece; flutes, ten times nearer, a tenth of it."""
SMALL_TURN = 0.5
"""While the rotary words turn by less (radians), the axis turns by the angle between its ends; else by that
of the words at most."""


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
    # an axis that turns by a, while its words turn by w, sways from a great circle by at most a w / 4
    words = np.abs(end[:, 3:] - start[:, 3:]).sum(1)
    turns = np.where(words < SMALL_TURN, angles_between(first_axes, last_axes), words)
    sways = cutter.length * turns * words / 4
    counts = np.ceil(np.sqrt(np.maximum(bows / 8 / STRAIGHT, sways / SWAY))).astype(np.int64).clip(1)

    above = len(cutter.profile) - 1
    owner, place = numbered(counts)
    tips, axes = control.between(start[owner], end[owner], place / counts[owner])
    end_tips, end_axes = control.between(start[owner], end[owner], (place + 1) / counts[owner])
    return Pieces(
        cutter.centres_of(tips, axes),
        cutter.centres_of(end_tips, end_axes),
        start_axes=axes,
        end_axes=end_axes,
        moves=moves[owner],
        reach=np.zeros(len(owner)),
        probed=(motions.rapid | motions.links)[moves][owner],
        bounds=np.full((len(owner), above), np.inf),
        near=np.zeros((len(owner), above, 2)),
        body=cutter.body,
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
