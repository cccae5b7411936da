"""How far a cylinder of a tool is from the material on one set of rays, compiled."""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.removal.rays import TILE, RaySet, bits, capsule_chord, cylinder_chord

SEARCH_STEPS = 24
"""Thirds that the interval of the least distance is divided into: to 1e-4 of its length."""


@njit(cache=True, nogil=True)
def _cylinder_distance(
    u: float, v: float, w: float, foot: ndarray, axis: ndarray, start: float, end: float, radius: float
) -> float:
    """Signed distance of the point (u, v, w) to a cylinder about the unit `axis` from `foot`."""
    x, y, z = u - foot[0], v - foot[1], w - foot[2]
    along = x * axis[0] + y * axis[1] + z * axis[2]
    out = np.sqrt(max(x * x + y * y + z * z - along * along, 0.0)) - radius
    up = max(start - along, along - end)
    return min(max(out, up), 0.0) + np.sqrt(max(out, 0.0) ** 2 + max(up, 0.0) ** 2)


@njit(cache=True, nogil=True)
def _least_distance(
    u: float,
    v: float,
    low: float,
    high: float,
    foot: ndarray,
    axis: ndarray,
    start: float,
    end: float,
    radius: float,
) -> float:
    """The least signed distance to the cylinder on the interval [low, high] of the ray through (u, v), by thirds."""
    for _ in range(SEARCH_STEPS):
        if high - low < 1e-3:
            break
        one, two = low + (high - low) / 3, high - (high - low) / 3
        at_one = _cylinder_distance(u, v, one, foot, axis, start, end, radius)
        at_two = _cylinder_distance(u, v, two, foot, axis, start, end, radius)
        if at_one < at_two:
            high = two
        else:
            low = one
    at_low = _cylinder_distance(u, v, low, foot, axis, start, end, radius)
    return min(at_low, _cylinder_distance(u, v, high, foot, axis, start, end, radius))


@njit(cache=True, nogil=True)
def cylinder_clearance(
    rays: RaySet, foot: ndarray, axis: ndarray, start: float, end: float, radius: float, within: float
) -> float:
    """The least signed distance between the material on the rays and a cylinder, or `within` where it is
    more.

    Rays are taken a quarter of `within` apart: the nearest of them is then told to within / 64.
    The cylinder runs from `start` to `end` along the unit `axis` from `foot` (u, v, w). Signed distance to a
    convex body is convex along a ray, so thirds of an interval find its least value.
    """
    best = within
    apart = min(max(int(within / 4 / rays.cell), 1), TILE)
    cell, side = rays.cell, rays.cell * TILE
    length = end - start
    dx, dy, dz = axis[0], axis[1], axis[2]
    px, py, pz = foot[0] + start * axis[0], foot[1] + start * axis[1], foot[2] + start * axis[2]
    qx, qy = foot[0] + end * axis[0], foot[1] + end * axis[1]
    wide = radius + max(within, 0.0)
    rows, columns = rays.tile_of.shape
    first_u = max(int(np.floor((min(px, qx) - wide) / side)), 0)
    last_u = min(int(np.floor((max(px, qx) + wide) / side)), rows - 1)
    first_v = max(int(np.floor((min(py, qy) - wide) / side)), 0)
    last_v = min(int(np.floor((max(py, qy) + wide) / side)), columns - 1)
    half_diagonal = side * np.sqrt(0.5)
    for i in range(first_u, last_u + 1):
        for j in range(first_v, last_v + 1):
            tile = rays.tile_of[i, j]
            if tile < 0 or rays.low[tile] > rays.high[tile]:
                continue
            # the ray through the tile's middle, with all as much larger as the tile is wide
            more = best + half_diagonal
            x, y = (i + 0.5) * side - px, (j + 0.5) * side - py
            lowest, highest = cylinder_chord(x, y, dx, dy, dz, -more, length + more, radius + more)
            lowest, highest = pz + lowest, pz + highest
            if lowest >= highest or lowest > rays.high[tile] or highest < rays.low[tile]:
                continue
            if not rays.mask[tile] & bits(lowest, highest, rays.length):
                continue
            for ray in range(TILE * TILE):
                count = rays.counts[tile, ray]
                if not count or (ray % TILE) % apart or (ray // TILE) % apart:
                    continue
                u = (i * TILE + ray % TILE + 0.5) * cell
                v = (j * TILE + ray // TILE + 0.5) * cell
                # nearer than the nearest so far: else the ray cannot tell more
                thick = radius + best
                if thick <= 0.0:
                    return best
                enter, leave = capsule_chord(u - px, v - py, axis[0], axis[1], axis[2], length, thick)
                for k in range(count):
                    low = max(rays.spans[tile, ray, 2 * k], pz + enter)
                    high = min(rays.spans[tile, ray, 2 * k + 1], pz + leave)
                    if low <= high:
                        found = _least_distance(u, v, low, high, foot, axis, start, end, radius)
                        best = min(best, found)
    return best
