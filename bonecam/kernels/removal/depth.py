"""How deep a ball on its way cuts into the material of one set of rays, compiled."""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.removal.air import air_on_set
from bonecam.kernels.removal.cut import tile_chords
from bonecam.kernels.removal.rays import TILE, RaySet, direction_of, tiles_reached


@njit(cache=True, nogil=True)
def capsule_depth(rays: RaySet, start: ndarray, end: ndarray, radius: float) -> float:
    """The largest distance to the nearest air, mm, of the places where the rays leave the capsule of `radius`
    about the segment from `start` to `end` (u, v, w) inside material; 0 where it meets none.

    Air is looked for on the rays of this set only, so the depth is too large by a cell at most.
    """
    side = rays.cell * TILE
    d, length = direction_of(start, end)
    lows, highs = np.empty(TILE * TILE), np.empty(TILE * TILE)
    deepest = 0.0
    for i, j in tiles_reached(rays, start, end, d, length, radius):
        tile_chords(i * side - start[0], j * side - start[1], rays.cell, d, length, radius, lows, highs)
        for ray in range(TILE * TILE):
            if lows[ray] >= highs[ray]:
                continue
            u = (i * TILE + ray % TILE + 0.5) * rays.cell
            v = (j * TILE + ray // TILE + 0.5) * rays.cell
            deepest = max(deepest, air_on_set(rays, u, v, start[2] + lows[ray]))
            deepest = max(deepest, air_on_set(rays, u, v, start[2] + highs[ray]))
    return deepest
