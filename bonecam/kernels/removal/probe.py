"""What tools would remove from the material of one set of rays, which stays as it is, compiled."""

from typing import Any

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.removal.body import body_in_motion, cut_body
from bonecam.kernels.removal.cut import cut_capsule
from bonecam.kernels.removal.flutes import Ways, cut_flutes, flutes_meet, travel_of
from bonecam.kernels.removal.rays import RaySet, direction_of, tiles_reached


@inner_njit()
def _add_tiles(rays: RaySet, start: ndarray, end: ndarray, radius: float, tiles: ndarray, count: int) -> int:
    """Add the tiles that a capsule may reach to the first `count` of `tiles`; their number then."""
    d, length = direction_of(start, end)
    for a, b in tiles_reached(rays, start, end, d, length, radius):
        tile = rays.tile_of[a, b]
        known = False
        for k in range(count):
            known = known or tiles[k] == tile
        if not known:
            tiles[count] = tile
            count += 1
    return count


@inner_njit()
def _tiles_of(rays: RaySet, ways: Ways, first: int, last: int, radius: float, tiles: ndarray) -> int:
    """Write the tiles that a tool may reach on the ways from `first` to `last` into `tiles`; their number."""
    foot, axis, start, top = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    count: Any = np.int64(0)  # a literal would have `_add_tiles` compiled once more
    for i in range(first, last):
        if len(ways.body):
            # the body lies in a capsule about its axis in the middle of the way, larger by half of what it travels
            wide = body_in_motion(ways, i, foot, axis, start, top)
            count = _add_tiles(rays, start, top, wide, tiles, count)
            continue
        count = _add_tiles(rays, ways.starts[i], ways.ends[i], radius, tiles, count)
        if ways.reach[i] <= 0.0 or not flutes_meet(rays, ways, i, radius, foot, axis):
            continue
        half = travel_of(ways, i, ways.reach[i]) / 2
        for k in range(3):
            top[k] = foot[k] + (ways.reach[i] + 2 * half) * axis[k]
        count = _add_tiles(rays, foot, top, radius + half, tiles, count)
    return count


@inner_njit()
def _cut(
    rays: RaySet, ways: Ways, i: int, radius: float, foot: ndarray, axis: ndarray, top: ndarray
) -> tuple[float, bool]:
    """Take what ball and flutes sweep on way `i` out of the material: the volume (mm^3), and whether a ray has no more
    room."""
    if len(ways.body):
        return cut_body(rays, ways, i, foot, axis)
    volume, full = cut_capsule(rays, ways.starts[i], ways.ends[i], radius, np.bool_(False))
    if full:
        return volume, True
    by_flutes, full = cut_flutes(rays, ways, i, radius, foot, axis, top)
    return volume + by_flutes, full


@inner_njit()
def _volume(rays: RaySet, ways: Ways, first: int, last: int, gone: int, radius: float) -> float:
    """What a tool removes on the ways from `first` to `last`, mm^3, but for those before `gone`; negative where a ray
    has no room for one more interval."""
    foot, axis, top = np.empty(3), np.empty(3), np.empty(3)
    volume = 0.0
    for i in range(first, last):
        removed, full = _cut(rays, ways, i, radius, foot, axis, top)
        if full:
            return -1.0
        if i >= gone:
            volume += removed
    return volume


@inner_njit()
def _room_for(rays: RaySet, count: int) -> RaySet:
    """A set with room for `count` tiles of the rays."""
    spans = np.empty((count, rays.spans.shape[1], rays.spans.shape[2]), dtype=np.float32)
    counts = np.empty((count, rays.counts.shape[1]), dtype=np.uint8)
    mask, stale = np.empty(count, dtype=np.uint64), np.empty(count, dtype=np.bool_)
    return RaySet(rays.tile_of, spans, counts, np.empty(count), np.empty(count), mask, stale, rays.cell, rays.length)


@inner_njit()
def _copy_tile(source: RaySet, tile: int, target: RaySet, place: int) -> None:
    """Copy a tile of one set to the place of a tile of another."""
    for ray in range(source.spans.shape[1]):
        target.counts[place, ray] = source.counts[tile, ray]
        for k in range(source.spans.shape[2]):
            target.spans[place, ray, k] = source.spans[tile, ray, k]
    target.low[place], target.high[place] = source.low[tile], source.high[tile]
    target.mask[place], target.stale[place] = source.mask[tile], source.stale[tile]


@njit(cache=True, nogil=True)
def probe(rays: RaySet, ways: Ways, ends: ndarray, gone: ndarray, radius: float, first: int, volumes: ndarray) -> int:
    """Write what a tool would remove on the ways of each line into `volumes` (k,), mm^3, from line `first` on; returns
    the line at which a ray has no room for one more interval, or their number.

    The ways of line i end before `ends` (k,) i; what is removed on those before `gone` (k,) i is taken as gone before
    the line is.
    """
    tiles = np.empty(len(rays.counts), dtype=np.int64)
    for i in range(first, len(ends)):
        start = ends[i - 1] if i else 0
        count = _tiles_of(rays, ways, start, ends[i], radius, tiles)
        kept = _room_for(rays, count)
        for k in range(count):
            _copy_tile(rays, tiles[k], kept, k)
        volumes[i] = _volume(rays, ways, start, ends[i], gone[i], radius)
        for k in range(count):
            _copy_tile(kept, k, rays, tiles[k])
        if volumes[i] < 0.0:
            return i
    return len(ends)


@njit(cache=True, nogil=True)
def cut_ways(rays: RaySet, ways: Ways, radius: float, first: int) -> int:
    """Take what a tool sweeps on its ways out of the material, from way `first` on; returns the way at which a ray has
    no room for one more interval, or their number."""
    foot, axis, top = np.empty(3), np.empty(3), np.empty(3)
    for i in range(first, len(ways.starts)):
        if _cut(rays, ways, i, radius, foot, axis, top)[1]:
            return i
    return len(ways.starts)
