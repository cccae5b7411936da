"""What the bodies of a tool take out of the material of one set of rays, and how far they stay from it; compiled.

Flutes above a ball stand in steps along a move.

Of a cone of the tool and an upright cylinder about the Z axis two points, one on either body, are projected onto the
other body in turn, from the common perpendicular of the axes on; the plane between them bounds the distance from below.
Along faces that are almost parallel that creeps: there the nearest point lies on a rim, so the rims are searched too.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.rays import (
    ALONG_U,
    ALONG_V,
    TILE,
    TINY,
    RaySet,
    air_on_set,
    cut_capsule,
    cylinder_chord,
    cylinder_meets,
    may_hold,
    steps_between,
)
from bonecam.kernels.vectors import cross, distance, dot, length, minus

FLUTE_STEP = 0.1
"""The flutes stand this far apart (mm) where they are taken out of the material: between two cuts of a
cylinder of radius R they leave a ridge of FLUTE_STEP^2 / (8 R), 1.3 um for 1 mm."""


class Ways(NamedTuple):
    """Straight moves of a ball's centre while the axis of its tool turns, in the coordinates of the rays: `starts`,
    `ends`, `start_axes`, `end_axes` (n, 3); `reach` (n,): height of the flutes above the ball's centre, mm, 0 for a
    ball alone."""

    starts: ndarray
    ends: ndarray
    start_axes: ndarray
    end_axes: ndarray
    reach: ndarray


@inner_njit()
def _capsule_chord(
    x: float, y: float, dx: float, dy: float, dz: float, length: float, radius: float
) -> tuple[float, float]:
    """Where a ray along w lies in a capsule: w from its start's; the first is larger where it misses.

    The ray is at (x, y) from the capsule's start, whose axis has the unit direction (dx, dy, dz) and
    `length`.
    """
    low, high = np.inf, -np.inf
    square = radius * radius
    rest = square - x * x - y * y
    if rest > 0.0:
        half = np.sqrt(rest)
        low, high = -half, half
    if length <= 0.0:
        return low, high
    ex = x - length * dx
    ey = y - length * dy
    ez = length * dz
    rest = square - ex * ex - ey * ey
    if rest > 0.0:
        half = np.sqrt(rest)
        low, high = min(low, ez - half), max(high, ez + half)
    across = 1.0 - dz * dz
    if across > TINY:
        along = x * dx + y * dy
        rest = along * along * dz * dz - across * (x * x + y * y - along * along - square)
        if rest > 0.0:
            root = np.sqrt(rest)
            first, last = (along * dz - root) / across, (along * dz + root) / across
            if 0.0 <= along + first * dz <= length:
                low = min(low, first)
            if 0.0 <= along + last * dz <= length:
                high = max(high, last)
    return low, high


@inner_njit()
def piece_pose(ways: Ways, i: int, share: float, foot: ndarray, axis: ndarray) -> None:
    """Write the ball's centre and the unit axis at this share of way `i`."""
    for k in range(3):
        foot[k] = (1 - share) * ways.starts[i, k] + share * ways.ends[i, k]
        axis[k] = (1 - share) * ways.start_axes[i, k] + share * ways.end_axes[i, k]
    size = length(axis)
    for k in range(3):
        axis[k] /= size


@inner_njit()
def travel_of(ways: Ways, i: int, height: float) -> float:
    """How far a point of the tool at this distance from the ball's centre travels at most, mm."""
    return distance(ways.ends[i], ways.starts[i]) + distance(ways.end_axes[i], ways.start_axes[i]) * height


@inner_njit()
def flutes_meet(rays: RaySet, ways: Ways, i: int, radius: float, foot: ndarray, axis: ndarray) -> bool:
    """Whether the flutes may meet material: those in the middle of way `i`, larger by half of their travel, which
    `foot` and `axis` then hold."""
    reach = ways.reach[i]
    half = travel_of(ways, i, reach) / 2
    piece_pose(ways, i, 0.5, foot, axis)
    for k in range(3):
        foot[k] -= half * axis[k]
    return bool(cylinder_meets(rays, foot, axis, reach + 2 * half, radius + half))


@inner_njit()
def cut_flutes(
    rays: RaySet, ways: Ways, i: int, radius: float, foot: ndarray, axis: ndarray, top: ndarray
) -> tuple[float, bool]:
    """Take what the flutes sweep on way `i` out of the material, their place at its start left out; the volume removed
    (mm^3), and whether a ray has no room for one more interval. `foot`, `axis` and `top` (3,) are written on."""
    removed = 0.0
    if ways.reach[i] <= 0.0 or not flutes_meet(rays, ways, i, radius, foot, axis):
        return removed, False
    steps = max(int(np.ceil(travel_of(ways, i, ways.reach[i]) / FLUTE_STEP)), 1)
    for k in range(1, steps + 1):
        piece_pose(ways, i, k / steps, foot, axis)
        if not cylinder_meets(rays, foot, axis, ways.reach[i], radius):
            continue
        for n in range(3):
            top[n] = foot[n] + ways.reach[i] * axis[n]
        volume, full = cut_capsule(rays, foot, top, radius, np.bool_(True))
        removed += volume
        if full:
            return removed, True
    return removed, False


@inner_njit()
def deepest_end(rays: RaySet, i: int, j: int, w: float, lows: ndarray, highs: ndarray) -> float:
    """The largest distance to the nearest air, mm, of the ends of the chords, told from `w`, of tile (i, j)."""
    deepest = 0.0
    for ray in range(TILE * TILE):
        if lows[ray] < highs[ray]:
            u = (i * TILE + ALONG_U[ray]) * rays.cell
            v = (j * TILE + ALONG_V[ray]) * rays.cell
            deepest = max(deepest, air_on_set(rays, u, v, w + lows[ray]))
            deepest = max(deepest, air_on_set(rays, u, v, w + highs[ray]))
    return deepest


MOST_STEPS = 300
"""Projections at most; about ten are usual."""
TOLERANCE = 1e-3
"""Where the distance and its bound agree so well the search ends, mm."""
RIM_POINTS = 24
"""Points of a rim that are looked at first."""
RIM_STEPS = 16
"""Thirds of the arc between the two beside the best of them: to 0.1 um of a rim of 40 mm radius."""


@inner_njit()
def _onto_cone(p: ndarray, foot: ndarray, axis: ndarray, section: ndarray, nearest: ndarray) -> None:
    """Write the point of a cone that is nearest to `p` into `nearest`; `section` (4,): from, to along the unit `axis`
    from `foot`, radius at either."""
    start, end, first, last = section[0], section[1], section[2], section[3]
    along = dot(minus(p, foot), axis)
    for k in range(3):
        nearest[k] = p[k] - foot[k] - along * axis[k]
    out = length(nearest)
    height, radius = along, out
    inside = start <= along <= end and out * (end - start) <= first * (end - along) + last * (along - start)
    if not inside:
        # the nearest point of the side, then of either end
        sx, sy = end - start, last - first
        square = sx * sx + sy * sy
        share = min(max(((along - start) * sx + (out - first) * sy) / square, 0.0), 1.0) if square > 0.0 else 0.0
        height, radius = start + share * sx, first + share * sy
        best = np.hypot(along - height, out - radius)
        for level, wide in ((start, first), (end, last)):
            near = min(out, wide)
            if np.hypot(along - level, out - near) < best:
                best = np.hypot(along - level, out - near)
                height = level
                radius = near
    share = radius / out if out > 0.0 else 0.0
    for k in range(3):
        nearest[k] = foot[k] + height * axis[k] + share * nearest[k]


@inner_njit()
def _onto_column(p: ndarray, column: ndarray, nearest: ndarray) -> None:
    """Write the point of an upright cylinder that is nearest to `p`; `column` (3,): radius, z of top and bottom."""
    out = np.hypot(p[0], p[1])
    share = min(column[0] / out, 1.0) if out > 0.0 else 1.0
    nearest[0], nearest[1] = share * p[0], share * p[1]
    nearest[2] = min(max(p[2], column[2]), column[1])


@inner_njit()
def _cone_support(n: ndarray, foot: ndarray, axis: ndarray, section: ndarray, farthest: ndarray) -> None:
    """Write the point of a cone that is farthest along -n into `farthest`."""
    along = dot(n, axis)
    size = np.sqrt(max(1.0 - along * along, 0.0))
    height, radius = section[0], section[2]
    if section[1] * along - section[3] * size < section[0] * along - section[2] * size:
        height, radius = section[1], section[3]
    share = radius / size if size > 0.0 else 0.0
    for k in range(3):
        farthest[k] = foot[k] + height * axis[k] - share * (n[k] - along * axis[k])


@inner_njit()
def _column_support(n: ndarray, column: ndarray, farthest: ndarray) -> None:
    """Write the point of an upright cylinder that is farthest along n into `farthest`."""
    flat = np.hypot(n[0], n[1])
    share = column[0] / flat if flat > 0.0 else 0.0
    farthest[0], farthest[1] = share * n[0], share * n[1]
    farthest[2] = column[1] if n[2] > 0.0 else column[2]


@inner_njit()
def _rim_distance(foot: ndarray, axis: ndarray, section: ndarray, column: ndarray) -> float:
    """The least distance of a rim of the cone from the cylinder, or of a rim of the cylinder from the cone."""
    p, q, e = np.empty(3), np.empty(3), np.zeros(3)
    flat = np.hypot(axis[0], axis[1])
    e[0], e[1] = (-axis[1] / flat, axis[0] / flat) if flat > 0.0 else (1.0, 0.0)
    f = cross(axis, e)
    best = np.inf
    for rim in range(4):
        side = rim % 2
        low, high = 0.0, 2 * np.pi
        for step in range(1 + RIM_STEPS):
            count = RIM_POINTS if step == 0 else 2
            nearest = np.inf
            at = 0.0
            for m in range(count):
                angle = low + (high - low) * (m + (step > 0)) / (count + (step > 0))
                cosine, sine = np.cos(angle), np.sin(angle)
                if rim < 2:
                    for k in range(3):
                        p[k] = foot[k] + section[side] * axis[k] + section[2 + side] * (cosine * e[k] + sine * f[k])
                    _onto_column(p, column, q)
                else:
                    p[0], p[1], p[2] = column[0] * cosine, column[0] * sine, column[1 + side]
                    _onto_cone(p, foot, axis, section, q)
                if distance(p, q) < nearest:
                    nearest = distance(p, q)
                    at = angle
            half = 2 * np.pi / RIM_POINTS if step == 0 else (high - low) / 3
            low, high = at - half, at + half
            best = min(best, nearest)
    return best


@njit(cache=True, nogil=True)
def column_distance(foot: ndarray, axis: ndarray, section: ndarray, column: ndarray, within: float) -> float:
    """The distance of a cone of the tool from an upright cylinder, mm: 0 where they meet, `within` where it is more.

    `section` (4,): from, to along the unit `axis` from `foot`, radius at either; `column` (3,): radius, z of top
    and bottom.
    """
    x, y, n = np.empty(3), np.empty(3), np.empty(3)
    x_far, y_far = np.empty(3), np.empty(3)
    # where the axes are nearest to one another
    flat = axis[0] ** 2 + axis[1] ** 2
    along = -(foot[0] * axis[0] + foot[1] * axis[1]) / flat if flat > 0.0 else 0.0
    along = min(max(along, section[0]), section[1])
    for k in range(3):
        x[k] = foot[k] + along * axis[k]
    _onto_column(x, column, y)
    apart = np.inf
    for _ in range(MOST_STEPS):
        _onto_cone(y, foot, axis, section, x)
        _onto_column(x, column, y)
        apart = distance(x, y)
        if apart <= TOLERANCE:
            return 0.0
        for k in range(3):
            n[k] = (x[k] - y[k]) / apart
        _cone_support(n, foot, axis, section, x_far)
        _column_support(n, column, y_far)
        bound = dot(n, minus(x_far, y_far))
        if bound >= within:
            return within
        if apart - bound <= TOLERANCE:
            return apart
    return min(apart, _rim_distance(foot, axis, section, column), within)


SEARCH_STEPS = 24
"""Thirds that the interval of the least distance is divided into: to 1e-4 of its length."""


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
    sx, sy = end - start, last - radius
    share = min(max(((along - start) * sx + (out - radius) * sy) / (sx * sx + sy * sy), 0.0), 1.0)
    near = np.hypot(along - start - share * sx, out - radius - share * sy)
    near = min(near, np.hypot(along - start, max(out - radius, 0.0)))
    return min(near, np.hypot(along - end, max(out - last, 0.0)))


@inner_njit()
def _at(u: float, v: float, w: float, axis: ndarray, start: float, end: float, radius: float, taper: float) -> float:
    """Signed distance of the point (u, v, w), told from the tool's foot, to a cone about its unit `axis`."""
    p = u, v, w
    along = dot(p, axis)
    out = np.sqrt(max(dot(p, p) - along * along, 0.0))
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
    first_u, last_u = steps_between(min(px, qx) - wide, max(px, qx) + wide, side, rows)
    first_v, last_v = steps_between(min(py, qy) - wide, max(py, qy) + wide, side, columns)
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
            if lowest >= highest or not may_hold(rays, tile, lowest, highest):
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
                enter, leave = _capsule_chord(u - px, v - py, axis[0], axis[1], axis[2], length, thick)
                for k in range(count):
                    low = max(rays.spans[tile, ray, 2 * k], pz + enter)
                    high = min(rays.spans[tile, ray, 2 * k + 1], pz + leave)
                    if low <= high:
                        x, y = u - foot[0], v - foot[1]
                        low, high = low - foot[2], high - foot[2]
                        distance = _least_distance(x, y, low, high, axis, start, end, radius, taper)
                        best = min(best, distance)
    return best
