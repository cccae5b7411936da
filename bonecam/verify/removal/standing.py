"""Heights of the material that stands on a surface, along its normals, and what stands of a post that is parted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.removal.air import in_material
from bonecam.kernels.removal.rays import RaySet
from bonecam.nc.reading.motions import Motions
from bonecam.setup.holding import Post
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.toolpath.path import PARTING
from bonecam.verify.removal.groups import Group
from bonecam.verify.removal.rays import RayGrid

HIGHEST = 5.0
"""Material is told up to this height, mm."""
STEP = 0.02
"""Material is measured in steps of this, mm."""
SECTION = 0.02
"""Sections are measured at places so far apart, mm."""


@dataclass(frozen=True, eq=False)
class Standing:
    """Heights (n,) of what stands on the vertices of a level's mesh `before` and `after` its moves, mm."""

    level: int
    before: Float[ndarray, " n"]
    after: Float[ndarray, " n"]


def parted_bridge(
    groups: Sequence[Group],
    motions: Motions,
    tools: Mapping[int, Cutter],
    post: Post,
    sets: Sequence[RaySet],
    grid: RayGrid,
) -> float | None:
    """Diameter (mm) of the circle with the area of what stands of the post where its parting groove is deepest; None
    where no path parts."""
    parting = [group for group in groups if group.level == PARTING]
    if not parting:
        return None
    moves = np.concatenate([group.moves for group in parting])
    cuts = moves[~(motions.links | motions.rapid)[moves]]
    height = np.median(motions.tips[cuts, 2] + tools[parting[0].tool].radius * motions.axes[cuts, 2])
    side = np.arange(-post.radius, post.radius, SECTION) + SECTION / 2
    x, y = (each.ravel() for each in np.meshgrid(side, side))
    held = np.zeros(len(x), dtype=bool)
    in_material(*sets, grid.of_points(np.column_stack([x, y, np.full(len(x), height)])), held)
    return float(2 * SECTION * np.sqrt((held & (np.hypot(x, y) < post.radius)).sum() / np.pi))


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
