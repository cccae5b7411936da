"""What nails tell in the end: what stays on the part, and where a ball went into it."""

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.nc.reading.motions import Motions
from bonecam.planning.passes.contacts import at_post
from bonecam.verify.removal.nails import Nails
from bonecam.verify.removal.result import Left, Spot
from bonecam.workholding.post import Post

LEFT = 0.02
"""More material than this is left over, mm: twice the scallop height of a default finishing cutter."""


ENTERS = 0.01
"""A ball on a place that enters the part beside it by more does not fit there, mm: the gouge tolerance of a job."""


def measure_left(nails: Nails, post: Post | None, radius: float, motions: Motions) -> Left:
    """What stays; the post, if there is one, and the fillet stay that a ball of `radius` (mm, the smallest) leaves
    round it."""
    held = np.zeros(len(nails.points), dtype=bool)
    if post is not None:
        held = at_post(nails.points, nails.normals, post, radius)
    over = nails.heights > LEFT
    away = np.where(held, -np.inf, nails.heights)
    highest = int(np.argmax(away))
    lowest = int(np.argmin(nails.heights))
    standing = np.flatnonzero(over & ~held)
    hollow = _in_hollows(nails, standing, radius)
    return Left(
        mesh=nails.mesh,
        heights=nails.heights,
        highest=_spot(float(nails.heights[highest]), highest, nails, motions),
        deepest_gouge=_spot(-float(nails.heights[lowest]), lowest, nails, motions),
        by_reason={
            "post": float(nails.areas[over & held].sum()),
            "gouge": float(nails.areas[standing[hollow]].sum()),
            "reachable": float(nails.areas[standing[~hollow]].sum()),
        },
    )


def _in_hollows(nails: Nails, which: Int[ndarray, " k"], radius: float) -> Bool[ndarray, " k"]:
    """Whether a ball that touches the part at these nails would enter it at another nail."""
    centres = nails.points[which] + radius * nails.normals[which]
    nearest, _ = cKDTree(nails.points).query(centres)
    return np.asarray(nearest < radius - ENTERS)


def _spot(value: float, nail: int, nails: Nails, motions: Motions) -> Spot:
    """A figure at a nail, and the line of the move that cut it lowest (0: none did)."""
    x, y, z = (float(v) for v in nails.points[nail])
    owner = int(nails.owners[nail])
    return Spot(value, int(motions.lines[owner]) if owner >= 0 else 0, (x, y, z))
