"""The depth of a cut: no sample goes farther from the level before than the cut is deep, less a margin for
what samples do not see."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.problem.cut import Cut

MARGIN, SHARE = 0.001, 0.005
"""The margin: so many mm (half of what a depth may exceed its limit by), or this share of the depth where that is
less."""


def depth(cut: Cut, gap: Float[ndarray, " k"]) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """Least and largest height, mm, of samples that are `gap` inside the stock at the level before."""
    return np.full(len(gap), -np.inf), np.full(len(gap), cut.depth - cut.margin * min(MARGIN, SHARE * cut.depth))
