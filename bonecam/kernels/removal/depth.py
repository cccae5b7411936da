"""How deep a ball on its way cuts into the material of one set of rays, compiled."""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.removal.air import air_on_set
from bonecam.kernels.removal.cut import reaches_tile, tile_chords, tiles_below
from bonecam.kernels.removal.rays import TILE, RaySet


@njit(cache=True, nogil=True)
def capsule_depth(rays: RaySet, start: ndarray, end: ndarray, radius: float) -> float:
    """The largest distance to the nearest air, mm, of the places where the rays leave the capsule of `radius`
    about the segment from `start` to `end` (u, v, w) inside material; 0 where it meets none.

    Air is looked for on the rays of this set only, so the depth is too large by a cell at most.
    """
    side = rays.cell * TILE
    d = end - start
    length = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    if length > 0.0:
        d /= length
    lows, highs = np.empty(TILE * TILE), np.empty(TILE * TILE)
    first_u, last_u, first_v, last_v = tiles_below(rays, start, end, radius)
    deepest = 0.0
    for i in range(first_u, last_u + 1):
        for j in range(first_v, last_v + 1):
            if not reaches_tile(rays, i, j, start, end, d, length, radius):
                continue
            tile_chords(i * side - start[0], j * side - start[1], rays.cell, d, length, radius, lows, highs)
            for ray in range(TILE * TILE):
                if lows[ray] >= highs[ray]:
                    continue
                u = (i * TILE + ray % TILE + 0.5) * rays.cell
                v = (j * TILE + ray // TILE + 0.5) * rays.cell
                deepest = max(deepest, air_on_set(rays, u, v, start[2] + lows[ray]))
                deepest = max(deepest, air_on_set(rays, u, v, start[2] + highs[ray]))
    return deepest
