"""Where rays lie in polyhedra, compiled.

Of a convex one the planes of the faces that a ray passes bound it. Every face is drawn in the grid of the rays. A plane
of another face than the one that a ray passes bounds the body too, so that rays through an edge, which count to both
faces, take no harm. Of any other the crossings with all faces are listed, an edge belonging to one of its two.
"""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.removal.rays import TILE, TINY

EDGE = 1e-9
"""A ray that passes a face outside by this share of its area passes it."""


@inner_njit()
def _rays_over(a: float, b: float, c: float, cell: float, count: int) -> tuple[int, int]:
    """The first and the last of `count` rows of rays, `cell` (mm) apart, that a triangle with these corners covers."""
    first = max(int(np.ceil(min(a, b, c) / cell - 0.5)), 0)
    return first, min(int(np.floor(max(a, b, c) / cell - 0.5)), count - 1)


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
        first, last = _rays_over(a[0], b[0], c[0], cell, rows)
        left, right = _rays_over(a[1], b[1], c[1], cell, columns)
        for i in range(first, last + 1):
            u = (i + 0.5) * cell
            for j in range(left, right + 1):
                tile = tile_of[i // TILE, j // TILE]
                ray = j % TILE * TILE + i % TILE
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


@njit(cache=True, nogil=True)
def count_crossings(corners: ndarray, cell: float, rows: int, columns: int) -> int:
    """How many times rays cross triangles, as `find_crossings`."""
    none = np.empty(0, dtype=np.int64)
    return find_crossings(corners, cell, rows, columns, none, np.empty(0), np.empty(0, dtype=np.int8))


@njit(cache=True, nogil=True)
def find_crossings(
    corners: ndarray, cell: float, rows: int, columns: int, ray: ndarray, w: ndarray, into: ndarray
) -> int:
    """Write the number `ray` = i columns + j, the place `w` (mm) and the sense `into` (1 into a body, -1 out of it) of
    each crossing, as far as there is room, and return how many there are.

    `corners` (f, 3, 3) are those of triangles, outwards, in u, v, w; ray (i, j) lies at u = (i + 1/2) `cell`, v = (j +
    1/2) `cell`. An edge belongs to one of the two triangles beside it: the side of an edge is found from its lower end,
    so both find the same.
    """
    crossings = 0
    for f in range(len(corners)):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        first, last = _rays_over(a[0], b[0], c[0], cell, rows)
        left, right = _rays_over(a[1], b[1], c[1], cell, columns)
        for i in range(first, last + 1):
            u = (i + 0.5) * cell
            for j in range(left, right + 1):
                v = (j + 0.5) * cell
                one, two, three = _left_of(a, b, u, v), _left_of(b, c, u, v), _left_of(c, a, u, v)
                if one != two or two != three:
                    continue
                if crossings < len(ray):
                    p = (b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])
                    q = (u - a[0]) * (c[1] - a[1]) - (v - a[1]) * (c[0] - a[0])
                    ray[crossings] = i * columns + j
                    w[crossings] = a[2] + (q * (b[2] - a[2]) + p * (c[2] - a[2])) / area
                    into[crossings] = -1 if area > 0.0 else 1
                crossings += 1
    return crossings


@inner_njit()
def _left_of(a: ndarray, b: ndarray, u: float, v: float) -> bool:
    """Whether (u, v) is to the left of the edge from a to b; of one and the same edge the two ways answer unlike."""
    back = b[0] < a[0] or (b[0] == a[0] and b[1] < a[1])
    p, q = (b, a) if back else (a, b)
    side = (q[0] - p[0]) * (v - p[1]) - (q[1] - p[1]) * (u - p[0])
    return (side > 0.0) != back
