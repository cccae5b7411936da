"""How far a ball comes down along a line until it touches the part (drop cutter, here by sphere tracing).

The distance of the ball to the part is the step that it can take safely, so that it never enters the part, and a
tool that is nowhere wider than its ball has a free way down too.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance
from bonecam.planning.layers.chart import Chart
from bonecam.planning.passes.contacts import POST_CLEARANCE
from bonecam.workholding.post import Post

TOUCHING = 2e-4
"""A ball that is no farther from the part touches it, mm."""
ROUNDS = 150
"""Steps of a ball at most; one that has not come to rest (it slides along a wall) stays where it is."""


@dataclass(frozen=True, eq=False)
class Ball:
    """A ball (radius, mm) that keeps `allowance` mm from the part, and POST_CLEARANCE from the post."""

    radius: float
    allowance: float
    part: MeshDistance
    post: Post

    def clearance(self, centres: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """How far balls may move in any direction, mm, before they are too near; all centres lie outside."""
        off = self.radius + self.allowance
        from_part = self.part.unsigned(centres) - off
        from_post = self.post.distance(centres) - self.radius - POST_CLEARANCE
        return np.minimum(from_part, from_post)

    def touches(self, centres: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether balls are as near to the part as they may be."""
        near = self.radius + self.allowance + 10 * TOUCHING
        return self.part.unsigned(centres, 2 * near) < near


def drop(
    bases: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    clearance: Callable[[Float[ndarray, "k 3"]], Float[ndarray, " k"]],
    top: float,
    floor: float,
) -> Float[ndarray, " n"]:
    """The heights at which points that come down their lines from `top` come to rest, at `floor` at the latest."""
    heights = np.full(len(bases), float(top))
    moving = np.arange(len(bases))
    for _ in range(ROUNDS):
        step = clearance(bases[moving] + heights[moving, None] * axes[moving])
        heights[moving] -= np.maximum(step, 0.0)
        moving = moving[(step > TOUCHING) & (heights[moving] >= floor)]
        if not len(moving):
            break
    return np.maximum(heights, floor)


def drop_balls(
    chart: Chart, a: Float[ndarray, " n"], b: Float[ndarray, " n"], ball: Ball, top: float, floor: float
) -> Float[ndarray, " n"]:
    """The heights of ball centres that came down their lines from `top`, mm; at `floor` at the lowest."""
    return drop(chart.bases(a, b), chart.axes(a), ball.clearance, top, floor)
