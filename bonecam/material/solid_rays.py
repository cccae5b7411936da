"""Closed meshes of any form on three sets of rays: material where they wind round a place more than once, so that
solids may overlap, touch and have hollows."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import ConvexHull

from bonecam.errors import JobError
from bonecam.kernels.hulls.polyhedron import count_crossings, find_crossings
from bonecam.kernels.removal.rays import TILE, RaySet, summarise
from bonecam.material.rays import ROOM, RayGrid, cell_that_fits, grid_round, order
from bonecam.mesh.triangle_mesh import TriangleMesh, side_by_side


def lay_solids(solids: Sequence[TriangleMesh], cell: float, memory_mb: float) -> tuple[list[RaySet], RayGrid]:
    """The union of closed outward meshes on three sets of rays `cell` mm apart, farther where they would need more
    memory; JobError where they hold nothing."""
    whole = side_by_side(solids)
    points = whole.vertices[np.unique(whole.faces)]
    grid = grid_round(points, cell)
    outlines = [ConvexHull(grid.of_points(points)[:, order(k)[:2]]).volume for k in range(3)]
    grid = grid_round(points, max(cell, cell_that_fits(sum(outlines), memory_mb)))
    return [_lay_set(whole, grid, k) for k in range(3)], grid


def _lay_set(whole: TriangleMesh, grid: RayGrid, direction: int) -> RaySet:
    """One set of rays, with the tiles in which any of them meets material."""
    columns = order(direction)
    corners = np.ascontiguousarray(grid.of_points(whole.vertices)[:, columns][whole.faces])
    tiles = np.ceil(grid.size[columns[:2]] / (TILE * grid.cell)).astype(int)
    shape = grid.cell, TILE * int(tiles[0]), TILE * int(tiles[1])
    count = count_crossings(corners, *shape)
    ray = np.empty(count, dtype=np.int64)
    w = np.empty(count)
    into = np.empty(count, dtype=np.int8)
    find_crossings(corners, *shape, ray, w, into)
    ray, low, high = _material(ray, w, into)
    if not len(ray):
        raise JobError("the solids hold no material: give closed meshes whose normals face outward")
    return _stored(ray, low, high=high, tiles=tiles, grid=grid, direction=direction)


def _material(
    ray: Int[ndarray, " n"], w: Float[ndarray, " n"], into: Int[ndarray, " n"]
) -> tuple[Int[ndarray, " k"], Float[ndarray, " k"], Float[ndarray, " k"]]:
    """The ray and the two ends of each stretch of material: from where the solids begin to wind round a place until
    they no longer do."""
    along = np.lexsort((-into, w, ray))
    ray = ray[along]
    w = w[along]
    into = into[along].astype(np.int64)
    winding = np.cumsum(into)
    starts = np.flatnonzero(np.diff(ray, prepend=-1))
    before = np.r_[0, winding][starts]
    winding = winding - np.repeat(before, np.diff(np.r_[starts, len(ray)]))
    was = winding - into
    begins, ends = np.flatnonzero((was <= 0) & (winding > 0)), np.flatnonzero((was > 0) & (winding <= 0))
    if winding[np.r_[starts[1:], len(ray)] - 1].any():
        raise JobError("a solid is not closed: give closed meshes")
    return ray[begins], w[begins], w[ends]


def _stored(
    ray: Int[ndarray, " k"],
    low: Float[ndarray, " k"],
    high: Float[ndarray, " k"],
    tiles: Int[ndarray, "2"],
    grid: RayGrid,
    direction: int,
) -> RaySet:
    """The stretches, which lie one behind the other on each ray, as a set of rays."""
    i, j = np.divmod(ray, TILE * tiles[1])
    tile = i // TILE * tiles[1] + j // TILE
    used, tile = np.unique(tile, return_inverse=True)
    within = j % TILE * TILE + i % TILE
    first = np.flatnonzero(np.diff(ray, prepend=-1))
    number = np.arange(len(ray)) - np.repeat(first, np.diff(np.r_[first, len(ray)]))
    room = max(ROOM, int(number.max()) + 1)
    spans = np.zeros((len(used), TILE * TILE, 2 * room), dtype=np.float32)
    spans[tile, within, 2 * number], spans[tile, within, 2 * number + 1] = low, high
    counts = np.zeros((len(used), TILE * TILE), dtype=np.uint8)
    np.add.at(counts, (tile, within), 1)
    tile_of = np.full(tiles[0] * tiles[1], -1, dtype=np.int32)
    tile_of[used] = np.arange(len(used))
    rays = RaySet(
        tile_of=tile_of.reshape(tuple(tiles)),
        spans=spans,
        counts=counts,
        low=np.zeros(len(used)),
        high=np.zeros(len(used)),
        mask=np.zeros(len(used), dtype=np.uint64),
        stale=np.zeros(len(used), dtype=bool),
        cell=grid.cell,
        length=float(grid.size[direction]),
    )
    summarise(rays)
    return rays
