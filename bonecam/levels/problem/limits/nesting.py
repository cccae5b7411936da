"""Nesting: no sample falls behind the level before (the published program leaves this out)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.problem.cut import Cut

MARGIN, SHARE = 0.001, 0.05
"""The margin: so many mm (as much as a level may fall behind when it is measured), or this share of the room to the
wall where that is less."""


def nesting(cut: Cut, gap: Float[ndarray, " k"]) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """Least and largest height, mm, of samples that are `gap` inside the stock at the level before: above
    zero where there is room."""
    return cut.margin * np.clip(SHARE * (gap - cut.clearance), 0, MARGIN), np.full(len(gap), np.inf)
