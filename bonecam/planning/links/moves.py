"""Tool positions that are arrived at one after the other, with their feeds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.tool.path import MoveKind

SAME = 1e-9
"""Poses whose coordinates (mm, and those of the axis) differ by less are one."""
Pose = tuple[Float[ndarray, "3"], Float[ndarray, "3"]]
"""Ball centre and unit tool axis."""


@dataclass(frozen=True)
class Feeds:
    """Feeds of links and of plunges, and the number given to rapid moves, mm/min."""

    link: float
    plunge: float
    rapid: float


@dataclass(frozen=True, eq=False)
class LinkMoves:
    """Row i: the move that arrives at ball centre i with axis i: its kind and feed (mm/min)."""

    kinds: Int[ndarray, " n"]
    centres: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    feeds: Float[ndarray, " n"]

    def __len__(self) -> int:
        return len(self.kinds)


NO_MOVES = LinkMoves(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
"""Nothing is between two runs: the tool cuts straight on."""


def moves_of(kind: MoveKind, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], feed: float) -> LinkMoves:
    """Moves of one kind at one feed."""
    return LinkMoves(np.full(len(centres), int(kind)), centres, axes, np.full(len(centres), feed))


def join_moves(moves: Sequence[LinkMoves]) -> LinkMoves:
    """All moves, one behind the other."""
    return LinkMoves(
        np.concatenate([m.kinds for m in moves]),
        np.vstack([m.centres for m in moves]),
        np.vstack([m.axes for m in moves]),
        np.concatenate([m.feeds for m in moves]),
    )


def without_rests(moves: LinkMoves) -> LinkMoves:
    """The moves but those that stay at the pose of the move before."""
    steps = np.diff(np.hstack([moves.centres, moves.axes]), axis=0)
    still = (np.abs(steps) < SAME).all(axis=1)
    kept = np.r_[True, ~still][: len(moves)]
    return LinkMoves(moves.kinds[kept], moves.centres[kept], moves.axes[kept], moves.feeds[kept])
