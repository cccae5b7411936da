"""What nails tell in the end: what stays on the part, and where a ball went into it."""

import numpy as np

from bonecam.nc.reading.motions import Motions
from bonecam.setup.holding import Post
from bonecam.verify.removal.nails import Nails
from bonecam.verify.removal.result import Left, Spot

LEFT = 0.02
"""More material than this is left over, mm: twice the scallop height of a default finishing cutter."""


def measure_left(nails: Nails, post: Post, radius: float, motions: Motions) -> Left:
    """What stays; within `radius` (mm, of the smallest ball) of the post the post and its fillet stay."""
    at_post = post.distance(nails.points) < radius
    over = nails.heights > LEFT
    away = np.where(at_post, -np.inf, nails.heights)
    highest = int(np.argmax(away))
    lowest = int(np.argmin(nails.heights))
    return Left(
        mesh=nails.mesh,
        heights=nails.heights,
        highest=_spot(float(nails.heights[highest]), highest, nails, motions),
        deepest_gouge=_spot(-float(nails.heights[lowest]), lowest, nails, motions),
        area=float(nails.areas[over & ~at_post].sum()),
        post_area=float(nails.areas[over & at_post].sum()),
    )


def _spot(value: float, nail: int, nails: Nails, motions: Motions) -> Spot:
    """A figure at a nail, and the line of the move that cut it lowest (0: none did)."""
    x, y, z = (float(v) for v in nails.points[nail])
    owner = int(nails.owners[nail])
    return Spot(value, int(motions.lines[owner]) if owner >= 0 else 0, (x, y, z))
