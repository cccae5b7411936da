"""Whether the moves read back from a posted text are those of the tool paths.

Every row of the paths must be reached, once and in order, by a move whose tip and axis agree. Moves in
between must lie on the path from one row to the next: the ball centre on the straight line, the axis on the
great circle. Rapids and feeds must be what the paths say.

Distances to a body and its copies at every pitch about the Z axis, from the mesh of one of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import VerifyError
from bonecam.kernels.matrices import align_moves
from bonecam.nc.dialect import Dialect
from bonecam.nc.motions import Motions
from bonecam.nc.path_words import SLOW, axis_minutes, joints_and_lengths
from bonecam.tool.path import MoveKind, ToolPath

FEED_TOLERANCE = 0.02
"""Share by which a feed that is written in inverse time may be off."""
MIN_LENGTH_STEPS = 20
"""A move shorter than this many last decimals of its words says nothing about its feed: feed / length."""


@dataclass(frozen=True)
class Tolerances:
    """What is asked of a posted text: tip and gouge in mm, axis in last decimals of its words."""

    tip: float = 0.002
    axis_steps: float = 1.5
    gouge: float = 0.01


@dataclass(frozen=True, eq=False)
class Readback:
    """The row (of `rows`) that each move reaches, its tip error (mm) and axis error (radians).

    `source` is the row (>= 0), -1 for a move outside the paths, or -2 - row for one between that row and the
    row before.
    """

    rows: int
    source: Int[ndarray, "n"]
    tip_error: Float[ndarray, "n"]
    axis_error: Float[ndarray, "n"]


def refuse_first(motions: Motions, wrong: Bool[ndarray, "n"], why: Callable[[int], str]) -> None:
    """VerifyError at the first `wrong` move, if there is one; `why` tells of a move what is wrong and the remedy."""
    if not wrong.any():
        return
    move = int(np.argmax(wrong))
    line = int(motions.lines[move])
    raise VerifyError(f"line {line}: {why(move)}", line=line, place=tuple(motions.tips[move].tolist()), error=np.inf)


def compare_moves(motions: Motions, paths: Sequence[ToolPath], dialect: Dialect, tolerances: Tolerances) -> Readback:
    """The row of the paths that each move reaches; VerifyError at the first move that belongs nowhere, is
    missing, or has the wrong tool or feed."""
    tips, axes = np.vstack([path.tips for path in paths]), np.vstack([path.axes for path in paths])
    kinds, feeds = np.concatenate([path.kinds for path in paths]), np.concatenate([path.feed_rates for path in paths])
    sizes = [len(path.tips) for path in paths]
    first = np.zeros(len(tips), dtype=bool)
    first[np.cumsum([0, *sizes[:-1]])] = True
    # a path may be left and taken up again at a rapid (a rewind)
    from_anywhere = first | (kinds == MoveKind.RAPID)
    axis_tolerance = np.radians(tolerances.axis_steps * dialect.numbers.angle.step)
    source, tip_error, axis_error, move, row = align_moves(
        motions.tips,
        motions.axes,
        # where rapids may be bent, the ways to a path and from it are links
        may_be_extra=motions.rapid | (motions.links & (not dialect.straight_rapids)),
        path_tips=tips,
        path_axes=axes,
        from_anywhere=from_anywhere,
        radius=np.repeat([path.cutter.radius for path in paths], sizes),
        tip_tolerance=tolerances.tip,
        axis_tolerance=axis_tolerance,
    )
    if move < len(motions.tips):
        raise _misplaced(motions, move, row, tips, axes)
    if row < len(tips):
        line = int(motions.lines[-1]) if len(motions.lines) else 0
        missing = len(tips) - row
        message = f"line {line}: the text ends {missing} points early: write it again"
        raise VerifyError(message, line=line, place=tuple(tips[row].tolist()), error=float(missing))

    reached = np.where(source >= 0, source, -2 - source)
    posted = source != -1

    tools = np.repeat([path.cutter.number for path in paths], sizes)[reached]
    refuse_first(
        motions,
        posted & (motions.tools != tools),
        lambda move: f"tool {motions.tools[move]} cuts what tool {tools[move]} was meant to: write it again",
    )

    begins = first[reached] | (from_anywhere[reached] & ~motions.known_start)
    # below this feed a block in inverse time may last as long as its slowest axis needs
    slow = np.repeat([SLOW * path.cutter.feed for path in paths], sizes)
    # Moves in inverse time that are slower than the feed `slow` and last as long as their slowest axis needs.
    needed = np.zeros(len(motions.tips))
    words = np.column_stack([motions.words[:, :3], np.degrees(motions.words[:, 3:])])
    for number, control in motions.controls.items():
        rows = motions.tools == number
        joints, _ = joints_and_lengths(control, words)
        needed[rows] = axis_minutes(control.machine, joints)[rows]
    share = motions.feed_rates * needed
    slower = motions.feed_rates * motions.lengths < np.minimum(slow, feeds)[reached]
    lasts = (share <= 1 + FEED_TOLERANCE) & (share >= 1 - FEED_TOLERANCE)
    by_turn = motions.inverse_time & slower & lasts
    by_turn &= (kinds[reached] != MoveKind.RAPID) | (not dialect.straight_rapids)
    _check_feeds(motions, posted & ~by_turn, kinds=kinds[reached], feeds=feeds[reached], begins=begins, dialect=dialect)
    return Readback(len(tips), source, tip_error, axis_error)


def _misplaced(
    motions: Motions, move: int, row: int, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]
) -> VerifyError:
    """The error of a move that is not where the paths go next, at `row`."""
    line = int(motions.lines[move])
    if row >= len(tips):
        message = f"line {line}: a move more than the paths have: write it again"
        return VerifyError(message, line=line, place=None, error=np.inf)
    off = float(np.linalg.norm(motions.tips[move] - tips[row]))
    angle = float(np.degrees(np.arccos(np.clip(motions.axes[move] @ axes[row], -1, 1))))
    message = (
        f"line {line}: tip off by {off:.4f} mm and axis by {angle:.4f} deg from point {row} of the paths: "
        "the text differs from them"
    )
    return VerifyError(message, line=line, place=tuple(tips[row].tolist()), error=off)


def _check_feeds(
    motions: Motions,
    posted: Bool[ndarray, "n"],
    kinds: Int[ndarray, "n"],
    feeds: Float[ndarray, "n"],
    begins: Bool[ndarray, "n"],
    dialect: Dialect,
) -> None:
    """VerifyError where a rapid is none, or a feed is not what its path says within the rounding of its word;
    a move that begins a path may be a rapid. Rapids that the control may bend are feeds at the rapid rate."""
    rapid = (kinds == MoveKind.RAPID) & dialect.straight_rapids
    length, written = motions.lengths, motions.tip_feeds
    feed = dialect.numbers.feed
    long_enough = length > MIN_LENGTH_STEPS * dialect.numbers.length.step
    below_limit = motions.feed_rates < feed.highest - feed.step
    checkable = ~motions.inverse_time | (long_enough & below_limit)
    allowed = np.where(motions.inverse_time, FEED_TOLERANCE * feeds + feed.step * length, feed.step)

    wrong_feed = ~motions.rapid & checkable & (np.abs(written - feeds) > allowed)
    wrong = posted & np.where(rapid, ~motions.rapid, (motions.rapid & ~begins) | wrong_feed)
    if wrong.any():
        move = int(np.argmax(wrong))
        line = int(motions.lines[move])
        meant = "rapid" if rapid[move] else f"{feeds[move]:g} mm/min"
        actual = "rapid" if motions.rapid[move] else f"{written[move]:g} mm/min"
        raise VerifyError(
            f"line {line}: feed is {actual}, meant {meant}: the text differs from the paths",
            line=line,
            place=tuple(motions.tips[move].tolist()),
            error=np.inf if motions.rapid[move] else float(abs(written[move] - feeds[move])),
        )
