"""How far the whole tool stays from table, chuck, what stands on the table and other solids, over all moves and between
them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from bonecam.arrays import angles_between, numbered, unit
from bonecam.kernels.removal.fixed import fixed_clearance
from bonecam.kernels.removal.sweep import Pieces
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.reading.motions import Motions
from bonecam.runtime.threads import in_pieces
from bonecam.tool.cutter import Cutter
from bonecam.verify.removal.pieces import straight_pieces
from bonecam.verify.removal.result import Clearance, Spot
from bonecam.verify.removal.sweeping import sections_of
from bonecam.workholding.clamping import Clamping

AT_ONCE = 16384
"""Pieces measured at once."""
NEAR = 0.2
"""Distances from a solid are told to this, mm."""
DEEPEST = -1e4
"""Columns without end go down to here, mm."""


def table_clearance(pieces: Pieces, cutter: Cutter, clamping: Clamping, within: float) -> tuple[float, int, str, int]:
    """The least distance (mm) of the tool from its clamping, its move and the part of the tool (-1 and none where it
    is more than `within`); and the first move in which they meet, -1 for none."""
    sections, _ = sections_of(cutter)
    names = [*(section.name for section in cutter.profile), "ball"]
    columns = np.array([replace(one, bottom=max(one.bottom, DEEPEST)).row for one in clamping.kept_off])

    def measure(some: slice) -> tuple[float, int, str, int]:
        part = Pieces._make([*(column[some] for column in pieces[:-1]), pieces.body])
        least, where, section, touched = fixed_clearance(
            part,
            sections,
            radius=cutter.envelope_radius,
            columns=columns.reshape(-1, 5),
            closed=clamping.closed,
            within=within,
        )
        move = int(part.moves[where]) if where >= 0 else -1
        return (least, move, names[section] if where >= 0 else "", int(part.moves[touched]) if touched >= 0 else -1)

    clearances = in_pieces(measure, len(pieces.starts), AT_ONCE)
    least, move, name, _ = min(clearances, key=lambda one: one[0])
    return least, move, name, min((one[3] for one in clearances if one[3] >= 0), default=-1)


def shell_clearance(motions: Motions, cutters: Sequence[Cutter], shell: TriangleMesh) -> Clearance:
    """How near the whole tool comes to the shell of a second clamping, to NEAR mm; they touch where that is not sure
    to be no contact."""
    solid = MeshDistance(shell)
    used = [(cutter, np.flatnonzero(motions.tools == cutter.number)) for cutter in cutters]
    clearances = [solid_clearance(motions, moves, cutter, solid) for cutter, moves in used if len(moves)]
    near, move = min(clearances)
    x, y, z = (float(value) for value in motions.tips[move])
    line = int(motions.lines[move])
    return Clearance("tool", Spot(near, line, (x, y, z)), line if near < NEAR else 0)


def solid_clearance(
    motions: Motions, moves: Int[ndarray, " m"], cutter: Cutter, solid: MeshDistance
) -> tuple[float, int]:
    """The least distance (mm, within NEAR) of the whole tool from a closed solid on moves of one cutter, and its
    move.

    The tool is a row of balls on its axis, as wide as it is there: what is between two of them is no nearer to the
    solid than they are by more than half of their distance. That is halved where it matters.
    """
    pieces = straight_pieces(motions, moves, cutter)

    # Moves, ball centres and axes of poses on pieces, between which no point of the tool moves by more than NEAR
    turns = angles_between(pieces.start_axes, pieces.end_axes)
    ways = np.linalg.norm(pieces.ends - pieces.starts, axis=1) + turns * cutter.length
    counts = np.ceil(ways / NEAR).astype(np.int64).clip(1)
    piece, place = numbered(counts)
    share = ((place + 1) / counts[piece])[:, None]
    centres = (1 - share) * pieces.starts[piece] + share * pieces.ends[piece]
    axes = unit((1 - share) * pieces.start_axes[piece] + share * pieces.end_axes[piece])
    owner = pieces.moves[piece]

    sections, _ = sections_of(cutter)
    best = np.inf
    where = int(moves[0])
    pose = np.repeat(np.arange(len(centres)), len(sections))
    low, high, radius, end_radius = np.tile(sections, (len(centres), 1)).T
    while len(pose):
        middle = (low + high) / 2
        distance = solid.signed(centres[pose] + middle[:, None] * axes[pose])
        near = distance - (radius + end_radius) / 2
        if near.min() < best:
            best = float(near.min())
            where = int(owner[pose[np.argmin(near)]])
        bound = distance - np.maximum(radius, end_radius) - (high - low) / 2
        open_ = (bound < best - NEAR) & (high - low > NEAR)
        pose, low, middle, high = pose[open_], low[open_], middle[open_], high[open_]
        first, last = radius[open_], end_radius[open_]
        pose = np.tile(pose, 2)
        low = np.r_[low, middle]
        high = np.r_[middle, high]
        radius = np.r_[first, (first + last) / 2]
        end_radius = np.r_[(first + last) / 2, last]
    return best, where
