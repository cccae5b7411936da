"""Signed distances of points from capsules, cylinders and columns of material, and bounds of them; compiled.

A solid is bounded by nested grids of distances. Outside it the distance d is semiconcave: d(x) - |x|^2 / (2 m) is
concave where d >= m. So its trilinear interpolant I on a cell of side h overestimates it by 3 h^2 / (8 m) at most, m
being the least distance in the cell, no less than the least one at a corner less half of the diagonal.

Upright cylinders are rows of `columns` (m, 5): radius, top, bottom, x and y, mm. A height field has line (i, j) from
base[i, j] along the unit axis[i]; its height is where the material on it ends, and balls lower it.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import CONTRACT, inner_njit, njit
from bonecam.kernels.vectors import dot, length, minus, times

ON_AXIS = 1e5 * np.finfo(np.float64).eps
"""Points nearer to the axis segment have a direction that is rounding alone: share of the capsule's size and
its distance from the origin."""


@njit(cache=True, fastmath=CONTRACT, nogil=True)
def distances_and_normals(
    points: ndarray, start: ndarray, axis: ndarray, radius: float, sideways: ndarray, distance: ndarray, out: ndarray
) -> None:
    """Write the signed distances (negative inside) into `distance` (n,) and the outward unit normals into
    `out` (n, 3).

    The axis segment goes from `start` to `start + axis`; points on it take the normal `sideways`.
    """
    square = dot(axis, axis)
    least = ON_AXIS * (radius + np.sqrt(square) + length(start))
    for l in range(len(points)):
        away = minus(points[l], start)
        along = min(max(dot(away, axis) / square, 0.0), 1.0) if square > 0.0 else 0.0
        away = minus(away, times(along, axis))
        reach = length(away)
        distance[l] = reach - radius
        for k in range(3):
            out[l, k] = away[k] / reach if reach > least else sideways[k]


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


@inner_njit()
def from_column(p: ndarray, column: ndarray) -> float:
    """The signed distance of a point from a solid upright cylinder, mm."""
    out = np.hypot(p[0] - column[3], p[1] - column[4]) - column[0]
    up = max(p[2] - column[1], column[2] - p[2])
    return min(max(out, up), 0.0) + np.hypot(max(out, 0.0), max(up, 0.0))


@njit(cache=True, nogil=True)
def column_bound(points: ndarray, columns: ndarray, distance: ndarray) -> None:
    """Lower each `distance` (n,), mm, to the signed one of its point (n, 3) from the nearest solid column, if that is
    less."""
    for i in range(len(points)):
        for c in range(len(columns)):
            distance[i] = min(distance[i], from_column(points[i], columns[c]))


@njit(cache=True, nogil=True)
def highest_over(
    centres: ndarray, directions: ndarray, offsets: ndarray, squares: ndarray, heights: ndarray, least: ndarray
) -> ndarray:
    """The largest of the `heights` (d, k), in falling order for each of the `directions` (d, 3), of which the point
    `offsets` (d, k) along the direction from each of the `centres` (n, 3) is over its column: nearer to the Z axis than
    the root of `squares` (d, k). No less than `least` (d); (n, d)."""
    highest = np.empty((len(centres), len(directions)))
    for i in range(len(centres)):
        for j in range(len(directions)):
            highest[i, j] = least[j]
            for k in range(heights.shape[1]):
                if heights[j, k] <= least[j]:
                    break
                x = centres[i, 0] + offsets[j, k] * directions[j, 0]
                y = centres[i, 1] + offsets[j, k] * directions[j, 1]
                if x * x + y * y < squares[j, k]:
                    highest[i, j] = heights[j, k]
                    break
    return highest


@njit(cache=True, nogil=True)
def _lowest(base: ndarray, axis: ndarray, centre: ndarray, square: float) -> float:
    """Where a line enters a ball, from below; infinite where it misses."""
    off = minus(centre, base)
    along = dot(off, axis)
    rest = square - (dot(off, off) - along * along)
    return along - np.sqrt(rest) if rest > 0.0 else np.inf


@njit(cache=True, nogil=True)
def lower(heights: ndarray, bases: ndarray, axes: ndarray, centres: ndarray, windows: ndarray, radius: float) -> None:
    """Lower the `heights` (a, b) to where balls cut the lines.

    The window of a ball is its first and last line each way; lines across are counted round.
    """
    square = radius * radius
    count = heights.shape[0]
    for c in range(len(centres)):
        first, last, begin, end = windows[c]
        for k in range(first, last + 1):
            i = k % count
            for j in range(begin, end + 1):
                low = _lowest(bases[i, j], axes[i], centres[c], square)
                if low < heights[i, j]:
                    heights[i, j] = low


@njit(cache=True, nogil=True)
def cut_heights(
    heights: ndarray,
    bottoms: ndarray,
    bases: ndarray,
    axes: ndarray,
    centres: ndarray,
    windows: ndarray,
    radius: float,
    cut: ndarray,
) -> None:
    """Set `cut` (n,) to the largest height of material that each ball alone would remove from a line; lines
    that end at their bottoms are empty."""
    square = radius * radius
    count = heights.shape[0]
    for c in range(len(centres)):
        first, last, begin, end = windows[c]
        most = 0.0
        for k in range(first, last + 1):
            i = k % count
            for j in range(begin, end + 1):
                if heights[i, j] > bottoms[i, j]:
                    low = _lowest(bases[i, j], axes[i], centres[c], square)
                    most = max(most, heights[i, j] - max(low, bottoms[i, j]))
        cut[c] = most
