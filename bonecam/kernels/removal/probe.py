"""What balls would remove from the material of one set of rays, which stays as it is, compiled."""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.removal.cut import cut_capsule
from bonecam.kernels.removal.rays import RaySet, direction_of, tiles_reached


@njit(cache=True, nogil=True)
def _tiles_of(rays: RaySet, points: ndarray, radius: float, tiles: ndarray, count: int) -> int:
    """Add the tiles that a ball may reach on straight moves through `points` (n, 3) to the first `count` of `tiles`;
    their number then."""
    for i in range(len(points)):
        start = points[max(i - 1, 0)]
        d, length = direction_of(start, points[i])
        for a, b in tiles_reached(rays, start, points[i], d, length, radius):
            tile = rays.tile_of[a, b]
            known = False
            for k in range(count):
                known = known or tiles[k] == tile
            if not known:
                tiles[count] = tile
                count += 1
    return count


@njit(cache=True, nogil=True)
def _volume(rays: RaySet, removed: ndarray, points: ndarray, radius: float) -> float:
    """What a ball removes on straight moves through `points` (n, 3) behind balls at `removed` (k, 3), mm^3; negative
    where a ray has no room for one more interval."""
    for k in range(len(removed)):
        if cut_capsule(rays, removed[k], removed[k], radius)[1]:
            return -1.0
    volume = 0.0
    for i in range(len(points)):
        gone, full = cut_capsule(rays, points[max(i - 1, 0)], points[i], radius)
        if full:
            return -1.0
        volume += gone
    return volume


@njit(cache=True, nogil=True)
def probe(
    rays: RaySet, lines: ndarray, ends: ndarray, removed: ndarray, radius: float, first: int, volumes: ndarray
) -> int:
    """Write what a ball would remove on straight moves through each line of places into `volumes` (k,), mm^3, from line
    `first` on; returns the line at which a ray has no room for one more interval, or their number.

    `lines` (n, 3) (u, v, w) holds the places of all lines, those of line i end before `ends` (k,) i; `removed` (k, m,
    3): what balls at these places hold is taken as gone before the line is.
    """
    tiles = np.empty(len(rays.counts), dtype=np.int64)
    for i in range(first, len(ends)):
        points = lines[ends[i - 1] if i else 0 : ends[i]]
        count = _tiles_of(rays, points, radius, tiles, 0)
        if not count:
            volumes[i] = 0.0
            continue
        for k in range(removed.shape[1]):
            count = _tiles_of(rays, removed[i, k : k + 1], radius, tiles, count)
        kept = tiles[:count].copy()
        spans, counts, stale = rays.spans[kept], rays.counts[kept], rays.stale[kept]
        low, high, mask = rays.low[kept], rays.high[kept], rays.mask[kept]
        volumes[i] = _volume(rays, removed[i], points, radius)
        for k in range(count):
            rays.spans[kept[k]], rays.counts[kept[k]], rays.stale[kept[k]] = spans[k], counts[k], stale[k]
            rays.low[kept[k]], rays.high[kept[k]], rays.mask[kept[k]] = low[k], high[k], mask[k]
        if volumes[i] < 0.0:
            return i
    return len(ends)


@njit(cache=True, nogil=True)
def cut_moves(rays: RaySet, starts: ndarray, ends: ndarray, radius: float, first: int) -> int:
    """Take what a ball sweeps on straight moves (m, 3) out of the material, from move `first` on; returns the move at
    which a ray has no room for one more interval, or their number."""
    for i in range(first, len(starts)):
        if cut_capsule(rays, starts[i], ends[i], radius)[1]:
            return i
    return len(starts)
