"""Taking a capsule out of the material of one set of rays, compiled.

Tiles that the capsule cannot reach are left out by their ends and masks; the chords of the others are taken
for all rays of a tile at once, without branches, which compiles to vector instructions.
"""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.fastmath import CONTRACT
from bonecam.kernels.removal.rays import (
    FLAT,
    ROUNDING,
    SLIVER,
    TILE,
    TINY,
    RaySet,
    bits,
    cylinder_chord,
    direction_of,
    summarise_tile,
    tiles_reached,
)

FULL = -1.0
"""Told instead of a length or volume where a ray has no room for one more interval."""
ALONG_U = (np.arange(TILE * TILE) % TILE + 0.5).astype(np.float64)
ALONG_V = (np.arange(TILE * TILE) // TILE + 0.5).astype(np.float64)
"""Where the rays of a tile lie, in cells from its corner."""


@inner_njit()
def _cut_ray(spans: ndarray, counts: ndarray, ray: int, start: float, end: float) -> float:
    """Take [start, end] out of a ray of a tile; the length of material that was there, or FULL."""
    count = counts[ray]
    removed = 0.0
    k = 0
    while k < count:
        low, high = spans[ray, 2 * k], spans[ray, 2 * k + 1]
        if high <= start + ROUNDING:
            k += 1
            continue
        if low >= end - ROUNDING:
            break
        keeps_low, keeps_high = start - low > SLIVER, high - end > SLIVER
        if keeps_low and keeps_high:
            if 2 * count == spans.shape[1]:
                return FULL
            for j in range(2 * count - 1, 2 * k, -1):
                spans[ray, j + 2] = spans[ray, j]
            spans[ray, 2 * k + 1], spans[ray, 2 * k + 2] = start, end
            count += 1
            removed += end - start
            break
        if keeps_low:
            spans[ray, 2 * k + 1] = start
            removed += high - start
            k += 1
        elif keeps_high:
            spans[ray, 2 * k] = end
            removed += end - low
            break
        else:
            for j in range(2 * k, 2 * count - 2):
                spans[ray, j] = spans[ray, j + 2]
            count -= 1
            removed += high - low
    counts[ray] = count
    return removed


@inner_njit(fastmath=CONTRACT)
def tile_chords(
    u: float, v: float, cell: float, d: ndarray, length: float, radius: float, lows: ndarray, highs: ndarray
) -> None:
    """Write where each ray of the tile whose corner is at (u, v) from a capsule's start lies in the capsule:
    w from its start's; the low end is infinite where a ray misses it.

    The capsule has the axis direction `d` (3,) and `length`. Where a ray enters a cylinder about the whole
    axis, t along it, it enters the capsule by the ball at the t of the capsule that is nearest: the ray's
    entry into the ball at t is a convex function of t.
    """
    dx, dy, dz = d[0], d[1], d[2]
    square = radius * radius
    across = max(1.0 - dz * dz, TINY)
    share = 1.0 / across
    for ray in range(TILE * TILE):
        x, y = u + cell * ALONG_U[ray], v + cell * ALONG_V[ray]
        along = x * dx + y * dy
        rest = along * along * dz * dz - across * (x * x + y * y - along * along - square)
        root = np.sqrt(max(rest, 0.0))
        first = min(max(along + (along * dz - root) * share * dz, 0.0), length)
        last = min(max(along + (along * dz + root) * share * dz, 0.0), length)
        near = square - (x - first * dx) * (x - first * dx) - (y - first * dy) * (y - first * dy)
        far = square - (x - last * dx) * (x - last * dx) - (y - last * dy) * (y - last * dy)
        low = first * dz - np.sqrt(max(near, 0.0))
        highs[ray] = last * dz + np.sqrt(max(far, 0.0))
        lows[ray] = low if min(rest, near) > 0.0 else np.inf


@inner_njit()
def _end_flat(u: float, v: float, cell: float, d: ndarray, length: float, lows: ndarray, highs: ndarray) -> None:
    """End the chords of a tile at the plane across the axis at its end."""
    for ray in range(TILE * TILE):
        rest = length - (u + cell * ALONG_U[ray]) * d[0] - (v + cell * ALONG_V[ray]) * d[1]
        if d[2] > FLAT:
            highs[ray] = min(highs[ray], rest / d[2])
        elif d[2] < -FLAT:
            lows[ray] = max(lows[ray], rest / d[2])
        elif rest < 0.0:
            lows[ray] = np.inf


@inner_njit()
def cut_tile(rays: RaySet, tile: int, base: float, lows: ndarray, highs: ndarray) -> tuple[float, bool]:
    """Take chords, told from `base`, out of the rays of a tile: the length removed, and whether one has no
    more room.

    Balls come back to a tile that they cut: its ends and mask are set anew when one has come in vain.
    """
    removed, full = 0.0, False
    spans, counts = rays.spans[tile], rays.counts[tile]
    for ray in range(TILE * TILE):
        count = counts[ray]
        if count == 0 or lows[ray] >= highs[ray]:
            continue
        low, high = base + lows[ray], base + highs[ray]
        if high <= spans[ray, 0] or low >= spans[ray, 2 * count - 1]:
            continue
        gone = _cut_ray(spans, counts, ray, low, high)
        if gone < 0.0:
            full = True
            break
        removed += gone
    if removed > 0.0:
        rays.stale[tile] = True
    elif rays.stale[tile]:
        summarise_tile(rays, tile)
    return removed, full


@njit(cache=True, nogil=True)
def cut_capsule(rays: RaySet, start: ndarray, end: ndarray, radius: float, flat: bool) -> tuple[float, bool]:
    """Take the capsule of `radius` about the segment from `start` to `end` (u, v, w) out of the material; one
    that is `flat` ends at `end`, as flutes do.

    Returns the volume removed (mm^3), and whether a ray has no room for one more interval: then part of the
    capsule is still to be cut, and cutting it again with more room completes it.
    """
    cell = rays.cell
    side = rays.cell * TILE
    d, length = direction_of(start, end)
    lows, highs = np.empty(TILE * TILE), np.empty(TILE * TILE)
    removed = 0.0
    for i, j in tiles_reached(rays, start, end, d, length, radius):
        tile_chords(i * side - start[0], j * side - start[1], cell, d, length, radius, lows, highs)
        if flat:
            _end_flat(i * side - start[0], j * side - start[1], cell, d, length, lows, highs)
        in_tile, full = cut_tile(rays, np.int64(rays.tile_of[i, j]), start[2], lows, highs)
        removed += in_tile
        if full:
            return removed * cell * cell, True
    return removed * cell * cell, False


@inner_njit()
def cylinder_meets(rays: RaySet, foot: ndarray, axis: ndarray, length: float, radius: float) -> bool:
    """Whether a cylinder with flat ends, from `foot` (u, v, w) along the unit `axis`, meets material.

    A tile is left out where the ray through its middle, with all as much larger as the tile is wide, meets
    none of what stands in it.
    """
    cell = rays.cell
    side = rays.cell * TILE
    dx, dy, dz = axis[0], axis[1], axis[2]
    half_diagonal = side * np.sqrt(0.5)
    rows, columns = rays.tile_of.shape
    first_u = max(int(np.floor((foot[0] + min(length * dx, 0.0) - radius) / side)), 0)
    last_u = min(int(np.floor((foot[0] + max(length * dx, 0.0) + radius) / side)), rows - 1)
    first_v = max(int(np.floor((foot[1] + min(length * dy, 0.0) - radius) / side)), 0)
    last_v = min(int(np.floor((foot[1] + max(length * dy, 0.0) + radius) / side)), columns - 1)
    wide = radius + half_diagonal
    below = -half_diagonal
    above = length + half_diagonal
    for i in range(first_u, last_u + 1):
        for j in range(first_v, last_v + 1):
            tile = rays.tile_of[i, j]
            if tile < 0 or rays.low[tile] > rays.high[tile]:
                continue
            x, y = (i + 0.5) * side - foot[0], (j + 0.5) * side - foot[1]
            enter, leave = cylinder_chord(x, y, dx, dy, dz, below, above, wide)
            low, high = foot[2] + enter, foot[2] + leave
            if low >= high or low > rays.high[tile] or high < rays.low[tile]:
                continue
            if not rays.mask[tile] & bits(low, high, rays.length):
                continue
            for ray in range(TILE * TILE):
                x = (i * TILE + ALONG_U[ray]) * cell - foot[0]
                y = (j * TILE + ALONG_V[ray]) * cell - foot[1]
                enter, leave = cylinder_chord(x, y, dx, dy, dz, 0.0, length, radius)
                low, high = foot[2] + enter + ROUNDING, foot[2] + leave - ROUNDING
                for k in range(rays.counts[tile, ray]):
                    if max(low, rays.spans[tile, ray, 2 * k]) < min(high, rays.spans[tile, ray, 2 * k + 1]):
                        return True
    return False
