"""Heights of the material that stands on a surface, along its normals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.removal.air import in_material
from bonecam.kernels.removal.rays import RaySet
from bonecam.verify.removal.rays import RayGrid

HIGHEST = 5.0
"""Material is told up to this height, mm."""
STEP = 0.02
"""Material is measured in steps of this, mm."""


@dataclass(frozen=True, eq=False)
class Standing:
    """Heights (n,) of what stands on the vertices of a level's mesh `before` and `after` its moves, mm."""

    level: int
    before: Float[ndarray, " n"]
    after: Float[ndarray, " n"]


def standing_heights(
    points: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    sets: Sequence[RaySet],
    grid: RayGrid,
    step: float = STEP,
) -> Float[ndarray, " n"]:
    """How high (mm, HIGHEST at most, in whole `step`s) unbroken material stands on each point along its unit normal."""
    heights = np.zeros(len(points))
    standing = np.arange(len(points))
    for height in np.arange(step, HIGHEST + step / 2, step):
        held = np.zeros(len(standing), dtype=bool)
        in_material(*sets, grid.of_points(points[standing] + height * normals[standing]), held)
        standing = standing[held]
        if not len(standing):
            break
        heights[standing] = height
    return heights
