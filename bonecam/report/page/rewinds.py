"""Where a posted text leaves the part to rewind rotary axes, by its comments."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.header.header import comment
from bonecam.nc.posting.marks import LIFTED, REWIND
from bonecam.nc.reading.motions import Motions


def rewind_contents(text: str, motions: Motions, dialect: Dialect) -> dict[str, Float[ndarray, "k 3"]]:
    """`rewinds`: the tips (mm) from which the tool leaves for a rewind, in order; nothing where there is none."""
    marks = tuple(comment(mark, dialect) for mark in (LIFTED, REWIND))
    lines = [number for number, line in enumerate(text.split("\n"), 1) if line.endswith(marks)]
    before = np.searchsorted(motions.lines, lines) - 1
    return {"rewinds": motions.tips[np.maximum(before, 0)]} if lines else {}
