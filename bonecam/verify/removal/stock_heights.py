"""Heights of the material that stands on a surface, along its normals, and what stands of a post that is parted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.removal.air import in_material
from bonecam.kernels.removal.rays import TILE, RaySet, summarise
from bonecam.material.rays import RayGrid, order
from bonecam.nc.reading.motions import Motions
from bonecam.planning.layers.chart import FlatChart
from bonecam.planning.layers.height_field import HeightField
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import PARTING
from bonecam.verify.removal.groups import Group
from bonecam.workholding.post import Post

HIGHEST = 5.0
"""Material is told up to this height, mm."""
STEP = 0.02
"""Material is measured in steps of this, mm."""
SECTION = 0.02
"""Sections are measured at places so far apart, mm."""
HEIGHTS = 0.05
"""Sections of the post are no farther apart, mm."""


@dataclass(frozen=True, eq=False)
class StockHeights:
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
    """Diameter (mm) of the circle with the area of what stands of the post where it is thinnest, at the heights of the
    parting cuts; None where no path parts."""
    parting = [group for group in groups if group.level == PARTING]
    if not parting:
        return None
    moves = np.concatenate([group.moves for group in parting])
    cuts = moves[~(motions.links | motions.rapid)[moves]]
    cut = motions.tips[cuts, 2] + tools[parting[0].tool].radius * motions.axes[cuts, 2]
    heights = np.linspace(cut.min(), cut.max(), 1 + int(np.ceil(np.ptp(cut) / HEIGHTS)))
    side = np.arange(-post.radius, post.radius, SECTION) + SECTION / 2
    x, y, z = (each.ravel() for each in np.meshgrid(side, side, heights))
    held = np.zeros(len(x), dtype=bool)
    in_material(*sets, grid.of_points(np.column_stack([x, y, z])), held)
    held &= np.hypot(x, y) < post.radius
    least = min(int(held[z == height].sum()) for height in heights)
    return float(2 * SECTION * np.sqrt(least / np.pi))


def stock_heights(
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


def height_field_of_rays(
    chart: FlatChart, top: float, floor: float, sets: Sequence[RaySet], grid: RayGrid
) -> HeightField:
    """The material on the lines of a chart from the height `top`, which is above all of it, down to `floor`, mm."""
    axis = chart.axes(chart.a[:1])[0]
    a, b = (each.ravel() for each in np.meshgrid(chart.a, chart.b, indexing="ij"))
    heights = heights_of_material(chart.bases(a, b) + top * axis, axis, floor - top, sets, grid)
    tops = top + heights.reshape(len(chart.a), len(chart.b))
    return HeightField(chart, tops, np.full(tops.shape, floor))


def heights_of_material(
    starts: Float[ndarray, "n 3"], axis: Float[ndarray, "3"], floor: float, sets: Sequence[RaySet], grid: RayGrid
) -> Float[ndarray, " n"]:
    """How high (mm) above its start material reaches on each line along the unit `axis`, looked for from starts that
    lie above all of it down to the height `floor` (negative), in steps of STEP; `floor` where there is none."""
    heights = np.full(len(starts), floor)
    going = np.arange(len(starts))
    for height in np.arange(0.0, floor, -STEP):
        held = np.zeros(len(going), dtype=bool)
        in_material(*sets, grid.of_points(starts[going] + height * axis), held)
        heights[going[held]] = height
        going = going[~held]
        if not len(going):
            break
    return heights


def rays_above(rays: RaySet, grid: RayGrid, direction: int, height: float) -> RaySet:
    """A copy of the rays along a direction of the grid without what lies below the height z, mm."""
    u, v, _ = order(direction)
    i, j = np.nonzero(rays.tile_of >= 0)
    ray = np.arange(TILE * TILE)
    points = np.zeros((len(i), len(ray), 3))
    points[:, :, u] = rays.cell * (TILE * i[:, None] + ray % TILE + 0.5)
    points[:, :, v] = rays.cell * (TILE * j[:, None] + ray // TILE + 0.5)
    foot = grid.in_part(points.reshape(-1, 3))[:, 2].reshape(points.shape[:2])
    least = np.empty(foot.shape, dtype=np.float32)
    least[rays.tile_of[i, j]] = (height - foot) / grid.rotation[direction, 2]

    lows, highs = np.maximum(rays.spans[:, :, ::2], least[:, :, None]), rays.spans[:, :, 1::2]
    used = np.arange(lows.shape[2]) < rays.counts[:, :, None]
    kept = used & (lows < highs)
    first = np.argsort(~kept, axis=2, kind="stable")
    spans = np.stack([np.take_along_axis(ends, first, axis=2) for ends in (lows, highs)], axis=3)
    cut = rays._replace(
        spans=spans.reshape(rays.spans.shape),
        counts=kept.sum(axis=2).astype(np.uint8),
        low=rays.low.copy(),
        high=rays.high.copy(),
        mask=rays.mask.copy(),
        stale=rays.stale.copy(),
    )
    summarise(cut)
    return cut
