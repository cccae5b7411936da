"""Lower bounds of the distance to a solid from nested grids of distances, compiled.

Outside a solid the distance d is semiconcave: d(x) - |x|^2 / (2 m) is concave where d >= m. So its trilinear
interpolant I on a cell of side h overestimates it by 3 h^2 / (8 m) at most, m being the least distance in the cell, no
less than the least one at a corner less half of the diagonal.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import njit

ROUNDING = 1e-9
"""Distances from a plane across a side of a cell sum to the side; by this share of it they may seem to sum to more."""
HALF_DIAGONAL = 0.8660254037844387
"""Of a cube of side 1."""


class Grids(NamedTuple):
    """Grids from the finest to the coarsest: `cells` (g + 1, 8) with their side, lowest corner (x, y, z), both mm,
    counts of nodes (x, y, z), and where their distances begin in `values` (mm, of all nodes, z the fastest); the last
    row has the lowest and the highest corner of the solid's box behind its first place.

    Nodes inside the solid have the distance 0. Calls pass arrays by value: these two are as few as can be.
    """

    cells: ndarray
    values: ndarray


@njit(cache=True, nogil=True)
def flood(distances: ndarray, step: float, outside: ndarray) -> ndarray:
    """The distances (n, n, n) to a surface with all nodes set to 0 that no way leads to from the nodes (n^3, z the
    fastest) that are known to be `outside`.

    A way between neighbours crosses no surface where their distances sum to more than `step`.
    """
    nx, ny, nz = distances.shape
    flooded = np.zeros(distances.shape)
    reached = outside.copy().reshape(distances.shape)
    stack = np.empty(distances.size, dtype=np.int64)
    height = 0
    for node in range(len(outside)):
        if outside[node]:
            stack[height] = node
            height += 1
    while height:
        height -= 1
        node = stack[height]
        i, j, k = node // (ny * nz), node // nz % ny, node % nz
        for side in range(6):
            a = i + (side == 0) - (side == 1)
            b = j + (side == 2) - (side == 3)
            c = k + (side == 4) - (side == 5)
            if a < 0 or b < 0 or c < 0 or a >= nx or b >= ny or c >= nz or reached[a, b, c]:
                continue
            if distances[i, j, k] + distances[a, b, c] > (1 + ROUNDING) * step:
                reached[a, b, c] = True
                stack[height] = (a * ny + b) * nz + c
                height += 1
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if reached[i, j, k]:
                    flooded[i, j, k] = distances[i, j, k]
    return flooded


@njit(cache=True, nogil=True)
def distance_bound(cells: ndarray, values: ndarray, first: int, end: int, x: float, y: float, z: float) -> float:
    """A lower bound of the distance of a point to the solid of the rows `first` up to `end` of `cells`, mm; 0
    inside."""
    for g in range(first, end - 1):
        h = cells[g, 0]
        fx, fy, fz = (x - cells[g, 1]) / h, (y - cells[g, 2]) / h, (z - cells[g, 3]) / h
        if not (0 <= fx < cells[g, 4] - 1 and 0 <= fy < cells[g, 5] - 1 and 0 <= fz < cells[g, 6] - 1):
            continue
        ny, nz = int(cells[g, 5]), int(cells[g, 6])
        i, j, k = int(fx), int(fy), int(fz)
        fx, fy, fz = fx - i, fy - j, fz - k
        at = int(cells[g, 7]) + (i * ny + j) * nz + k
        beside = at + nz
        across = at + ny * nz
        beyond = across + nz
        a, b, c, d = values[at], values[beside], values[across], values[beyond]
        e, f, p, q = values[at + 1], values[beside + 1], values[across + 1], values[beyond + 1]
        least = min(a, b, c, d, e, f, p, q) - HALF_DIAGONAL * h
        if not least > 0:
            return 0.0
        a, b, c, d = a + fz * (e - a), b + fz * (f - b), c + fz * (p - c), d + fz * (q - d)
        a, c = a + fy * (b - a), c + fy * (d - c)
        return max(a + fx * (c - a) - 0.375 * h * h / least, least)
    dx = max(cells[end - 1, 1] - x, x - cells[end - 1, 4], 0.0)
    dy = max(cells[end - 1, 2] - y, y - cells[end - 1, 5], 0.0)
    dz = max(cells[end - 1, 3] - z, z - cells[end - 1, 6], 0.0)
    return np.sqrt(dx * dx + dy * dy + dz * dz)


@njit(cache=True, nogil=True)
def distance_bounds(grids: Grids, points: ndarray) -> ndarray:
    """Lower bounds of the distances of points (n, 3) to the solid, mm; 0 inside."""
    cells, values = grids.cells, grids.values
    bounds = np.empty(len(points))
    for i in range(len(points)):
        bounds[i] = distance_bound(cells, values, 0, len(cells), points[i, 0], points[i, 1], points[i, 2])
    return bounds
