"""Lower bounds of the distance to a solid from nested grids of distances, compiled.

Outside a solid the distance d is semiconcave: d(x) - |x|^2 / (2 m) is concave where d >= m. So its trilinear
interpolant I on a cell of side h overestimates it by 3 h^2 / (8 m) at most, m being the least distance in the cell, no
less than the least one at a corner less half of the diagonal.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy import ndarray

ROUNDING = 1e-9
"""Distances from a plane across a side of a cell sum to the side; by this share of it they may seem to sum to more."""
HALF_DIAGONAL = 0.8660254037844387
"""Of a cube of side 1."""


class Grids(NamedTuple):
    """Grids from the finest to the coarsest: sides of the cells (g,) and lowest corners (g, 3), mm; counts of
    nodes (g, 3); distances (mm) of all nodes, z the fastest, those of grid i from `starts` (g,) on.

    Nodes inside the solid have the distance 0. `low` and `high` (3,) bound the solid.
    """

    steps: ndarray
    origins: ndarray
    counts: ndarray
    starts: ndarray
    values: ndarray
    low: ndarray
    high: ndarray


@njit(cache=True, nogil=True)
def flood(distances: ndarray, step: float, outside: ndarray) -> ndarray:
    """The distances (n, n, n) to a surface with all nodes set to 0 that no way leads to from the nodes (n^3, z the
    fastest) that are known to be `outside`.

    A way between neighbours crosses no surface where their distances sum to more than `step`.
    """
    nx, ny, nz = distances.shape
    found = np.zeros(distances.shape)
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
                    found[i, j, k] = distances[i, j, k]
    return found


@njit(cache=True, nogil=True)
def distance_bound(grids: Grids, x: float, y: float, z: float) -> float:
    """A lower bound of the distance of a point to the solid, mm; 0 inside."""
    for g in range(len(grids.steps)):
        h = grids.steps[g]
        fx = (x - grids.origins[g, 0]) / h
        fy = (y - grids.origins[g, 1]) / h
        fz = (z - grids.origins[g, 2]) / h
        ny, nz = grids.counts[g, 1], grids.counts[g, 2]
        if fx < 0 or fy < 0 or fz < 0:
            continue
        if fx >= grids.counts[g, 0] - 1 or fy >= ny - 1 or fz >= nz - 1:
            continue
        i, j, k = int(fx), int(fy), int(fz)
        fx, fy, fz = fx - i, fy - j, fz - k
        first = grids.starts[g] + (i * ny + j) * nz + k
        least, value = np.inf, 0.0
        for a in range(2):
            for b in range(2):
                at = first + (a * ny + b) * nz
                one, other = grids.values[at], grids.values[at + 1]
                least = min(least, one, other)
                weight = (fx if a else 1 - fx) * (fy if b else 1 - fy)
                value += weight * ((1 - fz) * one + fz * other)
        least -= HALF_DIAGONAL * h
        return max(value - 0.375 * h * h / least, least) if least > 0 else 0.0
    dx = max(grids.low[0] - x, x - grids.high[0], 0.0)
    dy = max(grids.low[1] - y, y - grids.high[1], 0.0)
    dz = max(grids.low[2] - z, z - grids.high[2], 0.0)
    return np.sqrt(dx * dx + dy * dy + dz * dz)


@njit(cache=True, nogil=True)
def distance_bounds(grids: Grids, points: ndarray) -> ndarray:
    """Lower bounds of the distances of points (n, 3) to the solid, mm; 0 inside."""
    found = np.empty(len(points))
    for i in range(len(points)):
        found[i] = distance_bound(grids, points[i, 0], points[i, 1], points[i, 2])
    return found
