"""Whether the moves read back from a posted text are those of the tool paths.

Every row of the paths must be reached, once and in order, by a move whose tip and axis agree; moves in
between must lie on the straight way of the ball centre between two rows; rapids and feeds must be what the
paths say.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import VerifyError
from bonecam.kernels.align import align
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.motions import Motions
from bonecam.toolpath.path import Kind, ToolPath

FEED_TOLERANCE = 0.02


@dataclass(frozen=True)
class Tolerances:
    """What is asked of a posted text: tip and gouge in mm, axis in last decimals of its words."""

    tip: float = 0.002
    axis_steps: float = 1.5
    gouge: float = 0.01


@dataclass(frozen=True, eq=False)
class Readback:
    """Errors of every move and the row it reaches (>= 0), approaches (-1) or is on the way to (-2 - row)."""

    rows: int
    source: Int[ndarray, "n"]
    tip_error: Float[ndarray, "n"]
    axis_error: Float[ndarray, "n"]


def compare(
    motions: Motions, paths: Sequence[ToolPath], dialect: Dialect, tolerances: Tolerances
) -> Readback:
    """The moves laid along the paths; VerifyError at the first move that belongs nowhere, is missing, or has
    the wrong feed."""
    tips, axes = np.vstack([p.tips for p in paths]), np.vstack([p.axes for p in paths])
    kinds, feeds = (np.concatenate([getattr(p, name) for p in paths]) for name in ("kinds", "feed_rates"))
    sizes = [len(p.tips) for p in paths]
    radius = np.repeat([p.cutter.radius for p in paths], sizes)
    tools = np.repeat([p.cutter.number for p in paths], sizes)
    first = np.zeros(len(tips), dtype=bool)
    first[np.cumsum([0, *sizes[:-1]])] = True
    axis_tolerance = np.radians(tolerances.axis_steps * dialect.numbers["angle"].step)
    # a path may be left and taken up again at a rapid: a rewind
    fresh = first | (kinds == Kind.RAPID)
    source, tip_error, axis_error, move, row = align(
        motions.tips, motions.axes, motions.rapid, tips, axes, fresh, radius, tolerances.tip, axis_tolerance
    )
    if move < len(motions.tips):
        _raise_stray(motions, move, row, tips, axes)
    if row < len(tips):
        raise VerifyError(
            f"line {int(motions.lines[-1]) if len(motions.lines) else 0}: the text ends {len(tips) - row} points early: write it again",
            line=int(motions.lines[-1]) if len(motions.lines) else 0,
            place=tuple(tips[row].tolist()),
            error=float(len(tips) - row),
        )
    rows = np.where(source >= 0, source, -2 - source)
    posted = source != -1
    _check_tools(motions, posted, tools[rows])
    _check_feeds(
        motions, posted, kinds[rows], feeds[rows], first[rows] | (fresh[rows] & ~motions.known_start), dialect
    )
    return Readback(len(tips), source, tip_error, axis_error)


def _raise_stray(motions: Motions, move: int, row: int, tips: ndarray, axes: ndarray) -> None:
    line = int(motions.lines[move])
    if row >= len(tips):
        raise VerifyError(
            f"line {line}: a move more than the paths have: write it again",
            line=line,
            place=None,
            error=np.inf,
        )
    off = float(np.linalg.norm(motions.tips[move] - tips[row]))
    lean = float(np.degrees(np.arccos(np.clip(motions.axes[move] @ axes[row], -1, 1))))
    raise VerifyError(
        f"line {line}: tip off by {off:.4f} mm and axis by {lean:.4f} deg from point {row} of the paths: the text differs from them",
        line=line,
        place=tuple(tips[row].tolist()),
        error=off,
    )


def _check_tools(motions: Motions, posted: Bool[ndarray, "n"], tools: Int[ndarray, "n"]) -> None:
    wrong = posted & (motions.tools != tools)
    if wrong.any():
        move = int(np.argmax(wrong))
        line = int(motions.lines[move])
        raise VerifyError(
            f"line {line}: tool {int(motions.tools[move])} cuts what tool {int(tools[move])} was meant to: write it again",
            line=line,
            place=tuple(motions.tips[move].tolist()),
            error=np.inf,
        )


def _check_feeds(
    motions: Motions,
    posted: Bool[ndarray, "n"],
    kinds: Int[ndarray, "n"],
    feeds: Float[ndarray, "n"],
    begins: Bool[ndarray, "n"],
    dialect: Dialect,
) -> None:
    """Rapids are rapids, feeds are feeds, within the rounding of their words; a run's first move may be a
    rapid."""
    rapid = kinds == Kind.RAPID
    length = np.r_[0.0, np.linalg.norm(np.diff(motions.tips, axis=0), axis=1)]
    written = np.where(motions.inverse_time, motions.feed_rates * length, motions.feed_rates)
    feed = dialect.numbers["feed"]
    # a move of a few roundings of length says nothing about feed / length; nor does a feed at the control's
    # limit
    told = ~motions.inverse_time | (
        (length > 20 * dialect.numbers["length"].step) & (motions.feed_rates < feed.highest - feed.step)
    )
    allowed = np.where(motions.inverse_time, FEED_TOLERANCE * feeds + feed.step * length, feed.step)
    wrong = posted & np.where(
        rapid,
        ~motions.rapid,
        (motions.rapid & ~begins) | (~motions.rapid & told & (np.abs(written - feeds) > allowed)),
    )
    if wrong.any():
        move = int(np.argmax(wrong))
        line = int(motions.lines[move])
        meant = "rapid" if rapid[move] else f"{feeds[move]:g} mm/min"
        found = "rapid" if motions.rapid[move] else f"{written[move]:g} mm/min"
        raise VerifyError(
            f"line {line}: feed is {found}, meant {meant}: the text differs from the paths",
            line=line,
            place=tuple(motions.tips[move].tolist()),
            error=float(abs(written[move] - feeds[move])) if not motions.rapid[move] else np.inf,
        )
