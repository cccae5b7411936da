"""Where rays lie in a convex polyhedron, compiled: the planes of the faces that a ray passes bound it.

Every face is drawn in the grid of the rays. A plane of another face than the one that a ray passes bounds the body
too, so that rays through an edge, which count to both faces, take no harm.
"""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.removal.rays import TILE, TINY

EDGE = 1e-9
"""A ray that passes a face outside by this share of its area passes it."""


@njit(cache=True, nogil=True)
def polyhedron_chords(corners: ndarray, cell: float, tile_of: ndarray, low: ndarray, high: ndarray) -> None:
    """Raise `low` and lower `high` (tiles, rays of a tile) to where rays enter and leave a convex polyhedron: w, mm.
    `corners` (f, 3, 3) are those of its triangles, outwards, in u, v, w; `tile_of` numbers the tiles of a set of rays.
    A ray that passes no triangle keeps what it has."""
    rows, columns = TILE * tile_of.shape[0], TILE * tile_of.shape[1]
    for f in range(len(corners)):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        nu = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
        nv = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        nw = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if nw * nw <= TINY * (nu * nu + nv * nv):
            continue
        first = max(int(np.ceil(min(a[0], b[0], c[0]) / cell - 0.5)), 0)
        last = min(int(np.floor(max(a[0], b[0], c[0]) / cell - 0.5)), rows - 1)
        left = max(int(np.ceil(min(a[1], b[1], c[1]) / cell - 0.5)), 0)
        right = min(int(np.floor(max(a[1], b[1], c[1]) / cell - 0.5)), columns - 1)
        for i in range(first, last + 1):
            u = (i + 0.5) * cell
            for j in range(left, right + 1):
                tile, ray = tile_of[i // TILE, j // TILE], j % TILE * TILE + i % TILE
                v = (j + 0.5) * cell
                one = (b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])
                two = (c[0] - b[0]) * (v - b[1]) - (c[1] - b[1]) * (u - b[0])
                three = nw - one - two
                if tile < 0 or min(one / nw, two / nw, three / nw) < -EDGE:
                    continue
                w = a[2] - (nu * (u - a[0]) + nv * (v - a[1])) / nw
                if nw < 0.0:
                    low[tile, ray] = max(low[tile, ray], w)
                else:
                    high[tile, ray] = min(high[tile, ray], w)
