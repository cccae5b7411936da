"""The machine's table: what the part stands on, and what else stands there."""

import math
from dataclasses import dataclass

from bonecam.job.frustum import Frustum


@dataclass(frozen=True)
class Table:
    """A table whose top is z = 0: a disc about the Z axis of `radius`, or a plate that reaches to +-`half_width`
    along X and +-`half_depth` along Y; mm, infinite where it has no such edge.

    `open_beside`: what is below its plane beside it is free; else nothing of a tool goes below the plane.
    `standing`: the stack that stands on it round the Z axis, from z = 0 up.
    """

    radius: float = math.inf
    half_width: float = math.inf
    half_depth: float = math.inf
    open_beside: bool = False
    standing: tuple[Frustum, ...] = ()
