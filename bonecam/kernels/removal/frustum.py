"""How far a cylinder or cone of a tool is from the material on one set of rays, compiled."""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.removal.rays import TILE, RaySet, bits, capsule_chord, cylinder_chord

SEARCH_STEPS = 24
"""Thirds that the interval of the least distance is divided into: to 1e-4 of its length."""


@inner_njit()
def _segment_distance(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Distance of (x, y) from the segment from a to b."""
    sx, sy = bx - ax, by - ay
    share = min(max(((x - ax) * sx + (y - ay) * sy) / (sx * sx + sy * sy), 0.0), 1.0)
    return np.hypot(x - ax - share * sx, y - ay - share * sy)


@njit(cache=True, nogil=True)
def frustum_distance(along: float, out: float, start: float, end: float, radius: float, taper: float) -> float:
    """Signed distance to a cone from `start` to `end` on its axis, whose radius grows from `radius` by `taper` a
    mm, of a point that is `along` the axis and `out` from it."""
    last = radius + taper * (end - start)
    up = max(start - along, along - end)
    side = (out - radius - taper * (along - start)) / np.sqrt(1.0 + taper * taper)
    if max(up, side) <= 0.0:
        return max(up, side)
    if taper == 0.0:
        return np.hypot(max(out - radius, 0.0), max(up, 0.0))
    near = _segment_distance(along, out, start, radius, end, last)
    near = min(near, np.hypot(along - start, max(out - radius, 0.0)))
    return min(near, np.hypot(along - end, max(out - last, 0.0)))


@inner_njit()
def _at(u: float, v: float, w: float, axis: ndarray, start: float, end: float, radius: float, taper: float) -> float:
    """Signed distance of the point (u, v, w), told from the tool's foot, to a cone about its unit `axis`."""
    along = u * axis[0] + v * axis[1] + w * axis[2]
    out = np.sqrt(max(u * u + v * v + w * w - along * along, 0.0))
    return frustum_distance(along, out, start, end, radius, taper)


@inner_njit()
def _least_distance(
    u: float, v: float, low: float, high: float, axis: ndarray, start: float, end: float, radius: float, taper: float
) -> float:
    """The least signed distance to the cone on the interval [low, high] of the ray through (u, v), by thirds; all
    told from the tool's foot."""
    for _ in range(SEARCH_STEPS):
        if high - low < 1e-3:
            break
        one, two = low + (high - low) / 3, high - (high - low) / 3
        at_one = _at(u, v, one, axis, start, end, radius, taper)
        if at_one < _at(u, v, two, axis, start, end, radius, taper):
            high = two
        else:
            low = one
    at_low = _at(u, v, low, axis, start, end, radius, taper)
    return min(at_low, _at(u, v, high, axis, start, end, radius, taper))


@njit(cache=True, nogil=True)
def frustum_clearance(
    rays: RaySet, foot: ndarray, axis: ndarray, start: float, end: float, radius: float, taper: float, within: float
) -> float:
    """The least signed distance between the material on the rays and a cone, or `within` where it is more.

    Rays are taken a quarter of `within` apart: the nearest of them is then told to within / 64.
    The cone runs from `start` to `end` along the unit `axis` from `foot` (u, v, w), its radius grows by `taper` a
    mm; tiles and intervals are first looked at with a cylinder that holds it. Signed distance to a convex body is
    convex along a ray, so thirds of an interval find its least value.
    """
    best = within
    apart = min(max(int(within / 4 / rays.cell), 1), TILE)
    cell = rays.cell
    side = rays.cell * TILE
    length = end - start
    dx, dy, dz = axis[0], axis[1], axis[2]
    px, py, pz = foot[0] + start * axis[0], foot[1] + start * axis[1], foot[2] + start * axis[2]
    qx, qy = foot[0] + end * axis[0], foot[1] + end * axis[1]
    widest = max(radius, radius + taper * length)
    wide = widest + max(within, 0.0)
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
            lowest, highest = cylinder_chord(x, y, dx, dy, dz, -more, length + more, widest + more)
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
                thick = widest + best
                if thick <= 0.0:
                    return best
                enter, leave = capsule_chord(u - px, v - py, axis[0], axis[1], axis[2], length, thick)
                for k in range(count):
                    low = max(rays.spans[tile, ray, 2 * k], pz + enter)
                    high = min(rays.spans[tile, ray, 2 * k + 1], pz + leave)
                    if low <= high:
                        x, y = u - foot[0], v - foot[1]
                        low, high = low - foot[2], high - foot[2]
                        distance = _least_distance(x, y, low, high, axis, start, end, radius, taper)
                        best = min(best, distance)
    return best
