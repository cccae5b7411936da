"""The comments CUT and LINK of a program: they stand where feed moves begin to cut, or to lead from one pass to
another, so that the text tells which moves are meant to remove material."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.header.header import comment
from bonecam.toolpath.path import Kind


def with_marks(
    lines: Sequence[str], kinds: Int[ndarray, "n"], rapid: Bool[ndarray, "n"], dialect: Dialect
) -> list[str]:
    """The blocks of one run with the comments before them; `kinds` are those of the path, `rapid` the moves that
    are written as rapids."""
    states = np.where(rapid, Kind.RAPID, np.where(kinds == Kind.CUT, Kind.CUT, Kind.LINK))
    begins = np.flatnonzero((np.diff(states, prepend=Kind.RAPID) != 0) & ~rapid)
    marked = list(lines)
    # from the last row on, so that the rows before keep their places
    for row in begins[::-1].tolist():
        marked.insert(row, comment(Kind(states[row]).name, dialect))
    return marked
