"""The comments CUT and LINK of a program: they stand where feed moves begin to cut, or to lead from one pass to
another, so that the text tells which moves are meant to remove material; and those of rewinds."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from bonecam.nc.dialect import Dialect
from bonecam.nc.words import comment
from bonecam.tool.path import MoveKind

LIFTED = "LIFTED TO REWIND"
"""The comment of the way to the safe point and back, on which rotary axes are rewound."""
REWIND = "REWIND"
"""The comment of a retract for the rotary axes to be rewound."""


def with_marks(
    lines: Sequence[str],
    kinds: Int[ndarray, "n"],
    rapid: Bool[ndarray, "n"],
    lifted: Int[ndarray, " k"],
    dialect: Dialect,
) -> list[str]:
    """The blocks of one run with the comments before them; `kinds` are those of the path, `rapid` the moves that
    are written as rapids, `lifted` the moves that begin a lift."""
    states = np.where(rapid, MoveKind.RAPID, np.where(kinds == MoveKind.CUT, MoveKind.CUT, MoveKind.LINK))
    begins = np.flatnonzero((np.diff(states, prepend=MoveKind.RAPID) != 0) & ~rapid)
    marks = [(row, MoveKind(states[row]).name) for row in begins.tolist()]
    marks += [(row, LIFTED) for row in lifted.tolist()]
    marked = list(lines)
    # from the last row on, so that the rows before keep their places
    for row, name in sorted(marks, reverse=True):
        marked.insert(row, comment(name, dialect))
    return marked
