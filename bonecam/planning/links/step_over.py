"""Steps over on the surface: from the end of one pass the tool cuts straight on to the near start of the next."""

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.planning.axes.singularity import SINGULAR_ANGLE, least_polar_angles
from bonecam.planning.links.direct import MAX_TURN, Contacts
from bonecam.planning.links.link_space import LinkSpace


def steps_over(space: LinkSpace, ends: Contacts, starts: Contacts, longest: float) -> Bool[ndarray, " k"]:
    """Whether the tool may cut straight from each end to its start: no farther than `longest` (mm), by a small turn off
    the singularity, no deeper than at the deepest of them all, proven free of collision and gouge."""
    may = np.linalg.norm(starts[0] - ends[0], axis=1) <= longest
    may &= angles_between(ends[2], starts[2]) <= MAX_TURN
    axes = np.stack([ends[2], starts[2]], axis=1)
    may &= np.array([least_polar_angles(pair).min() > SINGULAR_ANGLE for pair in axes], dtype=bool)
    may[may] = space.no_deeper_between(ends[0][may], starts[0][may])
    may[may] = space.ball_free(ends[0][may], starts[0][may])
    if not may.any():
        return may
    centres = np.stack([ends[0], starts[0]], axis=1)[may].reshape(-1, 3)
    turned = axes[may].reshape(-1, 3)
    joined = np.tile([True, False], int(may.sum()))
    free = space.checker.moves_free(space.checker.cutter.tips_of(centres, turned), turned, joined)
    may[may] = free[::2]
    return may
