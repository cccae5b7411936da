"""Taking a capsule out of the material of one set of rays, compiled."""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.removal.rays import (
    SLIVER,
    TILE,
    RaySet,
    bits,
    capsule_chord,
    flat_distance,
    part_near,
    summarise_tile,
)

FULL = -1.0
"""Told instead of a length or volume where a ray has no room for one more interval."""

FLAT = 1e-9
"""Rays that rise along the axis by less than this lie across it."""


@njit(cache=True, nogil=True)
def cut_ray(rays: RaySet, tile: int, ray: int, start: float, end: float) -> float:
    """Take [start, end] out of a ray; the length of material that was there, or FULL."""
    spans = rays.spans[tile, ray]
    count = rays.counts[tile, ray]
    removed = 0.0
    k = 0
    while k < count:
        low, high = spans[2 * k], spans[2 * k + 1]
        if high <= start:
            k += 1
            continue
        if low >= end:
            break
        keeps_low, keeps_high = start - low > SLIVER, high - end > SLIVER
        if keeps_low and keeps_high:
            if 2 * count == len(spans):
                return FULL
            for j in range(2 * count - 1, 2 * k, -1):
                spans[j + 2] = spans[j]
            spans[2 * k + 1], spans[2 * k + 2] = start, end
            count += 1
            removed += end - start
            break
        if keeps_low:
            spans[2 * k + 1] = start
            removed += high - start
            k += 1
        elif keeps_high:
            spans[2 * k] = end
            removed += end - low
            break
        else:
            for j in range(2 * k, 2 * count - 2):
                spans[j] = spans[j + 2]
            count -= 1
            removed += high - low
    rays.counts[tile, ray] = count
    return removed


@njit(cache=True, nogil=True)
def cut_capsule(
    rays: RaySet, start: ndarray, end: ndarray, radius: float, flat: bool = False
) -> tuple[float, bool]:
    """Take the capsule of `radius` about the segment from `start` to `end` (u, v, w) out of the material; one
    that is `flat` ends at `end`, as flutes do.

    Returns the volume removed (mm^3), and whether a ray has no room for one more interval: then part of the
    capsule is still to be cut, and cutting it again with more room completes it.
    """
    cell, side = rays.cell, rays.cell * TILE
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    if length > 0.0:
        dx, dy, dz = dx / length, dy / length, dz / length
    rows, columns = rays.tile_of.shape
    first_u = max(int(np.floor((min(start[0], end[0]) - radius) / side)), 0)
    last_u = min(int(np.floor((max(start[0], end[0]) + radius) / side)), rows - 1)
    first_v = max(int(np.floor((min(start[1], end[1]) - radius) / side)), 0)
    last_v = min(int(np.floor((max(start[1], end[1]) + radius) / side)), columns - 1)
    half_diagonal = side * np.sqrt(0.5)
    removed = 0.0
    for i in range(first_u, last_u + 1):
        for j in range(first_v, last_v + 1):
            tile = rays.tile_of[i, j]
            if tile < 0 or rays.low[tile] > rays.high[tile]:
                continue
            far = flat_distance((i + 0.5) * side, (j + 0.5) * side, start[0], start[1], end[0], end[1])
            near = max(far - half_diagonal, 0.0)
            if near >= radius:
                continue
            half = np.sqrt(radius * radius - near * near)
            # only the part of the axis that passes the tile within the radius reaches it
            x, y = (i + 0.5) * side - start[0], (j + 0.5) * side - start[1]
            first, last = part_near(x, y, dx, dy, length, radius + half_diagonal)
            one, other = start[2] + first * dz, start[2] + last * dz
            low, high = min(one, other) - half, max(one, other) + half
            if low > rays.high[tile] or high < rays.low[tile]:
                continue
            if not rays.mask[tile] & bits(low, high, rays.length):
                continue
            middle = (first + last) / 2
            mx, my, mz = middle * dx, middle * dy, start[2] + middle * dz
            reach = (radius + (last - first) / 2) ** 2
            in_tile = 0.0
            for ray in range(TILE * TILE):
                count = rays.counts[tile, ray]
                if not count:
                    continue
                x = (i * TILE + ray % TILE + 0.5) * cell - start[0]
                y = (j * TILE + ray // TILE + 0.5) * cell - start[1]
                # the ball about that part, quicker than the capsule
                z = max(max(rays.spans[tile, ray, 0] - mz, mz - rays.spans[tile, ray, 2 * count - 1]), 0.0)
                if (x - mx) ** 2 + (y - my) ** 2 + z * z >= reach:
                    continue
                low, high = capsule_chord(x, y, dx, dy, dz, length, radius)
                if flat:
                    # the plane across the axis at its end
                    rest = length - x * dx - y * dy
                    if abs(dz) > FLAT:
                        low, high = (low, min(high, rest / dz)) if dz > 0.0 else (max(low, rest / dz), high)
                    elif rest < 0.0:
                        continue
                if low >= high:
                    continue
                gone = cut_ray(rays, tile, ray, start[2] + low, start[2] + high)
                if gone < 0.0:
                    summarise_tile(rays, tile)
                    return (removed + in_tile) * cell * cell, True
                in_tile += gone
            if in_tile > 0.0:
                summarise_tile(rays, tile)
                removed += in_tile
    return removed * cell * cell, False
