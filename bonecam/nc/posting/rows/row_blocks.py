"""The blocks of the moves of one run, with their feeds where these change and the comments before them."""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.axis_words import MoveWords, axis_moves, move_words
from bonecam.nc.posting.marks import with_marks
from bonecam.nc.posting.path_words import Posted
from bonecam.tool.path import MoveKind


def row_blocks(posted: Posted, run: tuple[int, int], machine: Machine, dialect: Dialect) -> list[str]:
    """The blocks of the moves of a run, one a row of its words, and its marks."""
    rows = slice(*run)
    kinds = posted.moves.kinds[rows]
    rates = dialect.numbers.feed.rounded_down(_rates(posted, rows))
    # the first row of a run is reached along the tool axis from the approach height
    fast = (kinds == MoveKind.RAPID) & dialect.straight_rapids
    fast[0] = dialect.straight_rapids or not dialect.tool_centre
    words, off = move_words(machine, dialect, posted.words[rows])
    lines = _blocks(words, rates, fast, dialect)
    if dialect.vector and off.any():
        by_angle = _blocks(axis_moves(machine, dialect, posted.words[rows]), rates, fast, dialect)
        for row in np.flatnonzero(off).tolist():
            lines[row] = by_angle[row]
            for start, own in dialect.vector.instead.items():
                lines[row] = own + lines[row].removeprefix(start) if lines[row].startswith(start) else lines[row]
    # the rows of the run that begin a way to the safe point and back to rewind rotary axes
    lifts = np.searchsorted(posted.moves.rows, posted.path.lifts[:, 0])
    lifted = lifts[(lifts >= run[0]) & (lifts < run[1])] - run[0]
    return with_marks(lines, kinds, fast, lifted, dialect)


def _blocks(words: MoveWords, rates: Float[ndarray, "n"], fast: Bool[ndarray, "n"], dialect: Dialect) -> list[str]:
    """The blocks of moves at their `rates` (feed words), rapids where they are `fast`."""
    form = " ".join(words.formats)
    rapid = "\n".join(dialect.move_lines("rapid", words=form))
    feed = "\n".join(dialect.move_lines("feed", words=form, feed=dialect.numbers.feed.spec))
    kept = "\n".join(dialect.move_lines("feed_kept", words=form))
    # behind a rapid, or behind a move of another feed
    changed = np.diff(np.where(fast, np.nan, rates), prepend=np.nan) != 0
    stated = ~fast & changed if kept else ~fast
    table = zip(words.numbers.tolist(), rates.tolist(), fast.tolist(), stated.tolist(), strict=True)
    return [
        feed % (*row, rate) if states else (rapid if quick else kept) % tuple(row) for row, rate, quick, states in table
    ]


def _rates(posted: Posted, rows: slice) -> Float[ndarray, "n"]:
    """The feed of each move as the dialect writes it: mm/min, or 1/min (inverse time)."""
    moves = posted.moves
    if posted.dialect.feed_mode == "per-minute":
        return moves.feed_rates[rows]
    length = posted.lengths[rows].copy()
    length[0] = 0.0
    with np.errstate(divide="ignore"):
        by_length = moves.feed_rates[rows] / length
        by_axes = 1 / posted.minutes[rows]
    return np.where(posted.by_turn[rows] | (length == 0.0), np.minimum(by_length, by_axes), by_length)
