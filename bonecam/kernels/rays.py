"""Material as intervals on parallel rays (a dexel model), compiled: what a set of rays is, and what cuts and asks it.

A set has one direction w and a square lattice of rays across it, u and v. Rays are kept in tiles of TILE x TILE, tile
by tile in memory, and only where there was material once. Material on a ray is a list of [low, high], rising.

A capsule is taken out tile by tile. Tiles that it cannot reach are left out by their ends and masks; the chords of the
others are taken for all rays of a tile at once, without branches, which compiles to vector instructions. How far places
in material are from air is asked of three sets of rays that cross one another. Coarse bricks of the material give lower
bounds of its distance from the cylinders and cones of a tool, a stack of them along its axis; heights are told from the
ball's centre.

A normal probe stands on a point of a surface along its normal; its height is that of the lowest cut above the surface.
Where a ball went in it is negative: how deep the point lies in the ball. The chord of the probe would tell more where
the ball only grazes it, at a thin edge for example, where it comes from the other side.

The edge of a ball end is looked for in the material before a move is cut. The ball is divided into cells (kappa, phi):
kappa from the tip, phi about the tool axis a from the feed on. With e_r the radial direction, a cell has the outward
normal n = sin(kappa) e_r - cos(kappa) a; it cuts where n . f > 0 (f the unit feed) and the point c + R n + s f lies in
material (c the middle of the move's centre line; s looks ahead of it by what the rays do not resolve). Each cell is
asked of the set of rays that lies most along n. One edge of length db = R dkappa then loads the work by (mechanistic,
with edge forces; Lee & Altintas 1996)

    (Ktc h + Kte) db v + (Krc h + Kre) db n + (Kac h + Kae) db m,    h = fz n . f,

where v = -a x e_r is the way of the edge (M3) and m = cos(kappa) e_r + sin(kappa) a the direction along it. Flutes
above the centre continue the ball with kappa = 90 degrees.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import CONTRACT, inner_njit, njit
from bonecam.kernels.closest_points import squared_triangle_distance
from bonecam.kernels.vectors import Three, distance, dot, length, minus, squared_segment_distance

TILE = 8
"""Rays along the side of a tile: with 4 a cut takes 5 % longer, with 16 45 %."""
BINS = 64
"""Parts of a ray's length whose material is told by one bit each."""
SLIVER = 1e-4
"""Material thinner than this on a ray is taken away, mm: what rounding leaves between two cuts."""
TINY = 1e-12
"""Squared lengths below this are rounding, mm^2."""
FLAT = 1e-9
"""Rays that rise along an axis by less than this lie across it."""
ROUNDING = 1e-5
"""Lengths below this are rounding, mm: float32 has steps of 4e-6 at 50 mm."""


class RaySet(NamedTuple):
    """One set of rays in its own coordinates u, v, w (mm, from the corner of the grid).

    `tile_of` (m, n): index of the tile, -1 where there never was material. `spans` (t, 64, 2 c) float32: low
    and high ends of the intervals of ray 8 j + i of a tile (i along u), of which `counts` (t, 64) are in use.
    `low`, `high` (t,): bounds of the material of a tile; `mask` (t,): bit b tells that there may be material
    in bin b of BINS; where `stale` (t,) is set both tell of what was there before. Ray number i lies at
    (i + 1/2) `cell`; rays are `length` long.
    """

    tile_of: ndarray
    spans: ndarray
    counts: ndarray
    low: ndarray
    high: ndarray
    mask: ndarray
    stale: ndarray
    cell: float
    length: float


@njit(cache=True, nogil=True)
def bits(low: float, high: float, length: float) -> np.uint64:
    """The bits of the bins that [low, high] meets."""
    first = min(max(int(low * BINS / length), 0), BINS - 1)
    last = min(max(int(high * BINS / length), 0), BINS - 1)
    mask = np.uint64(0xFFFFFFFFFFFFFFFF) >> np.uint64(BINS - 1 - (last - first))
    return mask << np.uint64(first)


@inner_njit()
def summarise_tile(rays: RaySet, tile: int) -> None:
    """Set the bounds and the mask of a tile from its intervals."""
    low = np.inf
    high = -np.inf
    mask = np.uint64(0)
    for ray in range(TILE * TILE):
        count = rays.counts[tile, ray]
        if count:
            low = min(low, rays.spans[tile, ray, 0])
            high = max(high, rays.spans[tile, ray, 2 * count - 1])
            for k in range(count):
                start, end = (np.float64(rays.spans[tile, ray, 2 * k]), np.float64(rays.spans[tile, ray, 2 * k + 1]))
                mask |= bits(start, end, rays.length)
    rays.low[tile] = low
    rays.high[tile] = high
    rays.mask[tile] = mask
    rays.stale[tile] = False


@njit(cache=True, nogil=True)
def summarise(rays: RaySet) -> None:
    """Set the bounds and masks of all tiles."""
    for tile in range(len(rays.counts)):
        summarise_tile(rays, tile)


@inner_njit()
def cylinder_chord(
    x: float, y: float, dx: float, dy: float, dz: float, low: float, high: float, radius: float
) -> tuple[float, float]:
    """Where a ray along w lies in a cylinder with flat ends: w from its foot's; the first is larger where it
    misses.

    The ray is at (x, y) from the foot of the axis, whose unit direction is (dx, dy, dz); the cylinder runs
    from `low` to `high` along it.
    """
    along = x * dx + y * dy
    across = max(1.0 - dz * dz, TINY)
    rest = along * along * dz * dz - across * (x * x + y * y - along * along - radius * radius)
    if rest <= 0.0:
        return np.inf, -np.inf
    root = np.sqrt(rest)
    first, last = (along * dz - root) / across, (along * dz + root) / across
    if abs(dz) > FLAT:
        one, other = (low - along) / dz, (high - along) / dz
        return max(first, min(one, other)), min(last, max(one, other))
    if low <= along <= high:
        return first, last
    return np.inf, -np.inf


@inner_njit()
def direction_of(start: ndarray, end: ndarray) -> tuple[ndarray, float]:
    """Unit direction and length of a capsule's axis; the direction of a ball is zero."""
    d = end - start
    size = length(d)
    if size > 0.0:
        d /= size
    return d, size


@inner_njit()
def steps_between(low: float, high: float, step: float, count: int) -> tuple[int, int]:
    """The first and the last of `count` steps from 0 on that lie between `low` and `high` in part."""
    return max(int(np.floor(low / step)), 0), min(int(np.floor(high / step)), count - 1)


@inner_njit()
def may_hold(rays: RaySet, tile: int, low: float, high: float) -> bool:
    """Whether a tile may have material between the heights `low` and `high`."""
    if tile < 0 or low > rays.high[tile] or high < rays.low[tile]:
        return False
    return bool(rays.mask[tile] & bits(low, high, rays.length))


@inner_njit()
def tiles_reached(rays: RaySet, start: ndarray, end: ndarray, d: ndarray, length: float, radius: float) -> ndarray:
    """The tiles (n, 2) along u and v whose material a capsule, whose axis has the unit direction `d` and `length`,
    may reach."""
    side = rays.cell * TILE
    half_diagonal = side * np.sqrt(0.5)
    sx, sy = end[0] - start[0], end[1] - start[1]
    seen_square, square = sx * sx + sy * sy, d[0] * d[0] + d[1] * d[1]
    rows, columns = rays.tile_of.shape
    first_u, last_u = steps_between(min(start[0], end[0]) - radius, max(start[0], end[0]) + radius, side, rows)
    first_v, last_v = steps_between(min(start[1], end[1]) - radius, max(start[1], end[1]) + radius, side, columns)
    tiles = np.empty((max(last_u - first_u + 1, 0) * max(last_v - first_v + 1, 0), 2), dtype=np.int64)
    count = 0
    for i in range(first_u, last_u + 1):
        for j in range(first_v, last_v + 1):
            tile = rays.tile_of[i, j]
            if tile < 0 or rays.low[tile] > rays.high[tile]:
                continue
            # seen along the rays: how near the axis comes to the middle of the tile
            x, y = (i + 0.5) * side - start[0], (j + 0.5) * side - start[1]
            share = min(max((x * sx + y * sy) / seen_square, 0.0), 1.0) if seen_square > TINY else 0.0
            off_x, off_y = x - share * sx, y - share * sy
            near = max(np.sqrt(off_x * off_x + off_y * off_y) - half_diagonal, 0.0)
            if near >= radius:
                continue
            # only the part of the axis that passes the tile within the radius reaches it
            first, last = 0.0, length
            if square > TINY:
                wide = radius + half_diagonal
                middle = (x * d[0] + y * d[1]) / square
                half = np.sqrt(max(wide * wide - (x * d[1] - y * d[0]) ** 2 / square, 0.0) / square)
                first, last = min(max(middle - half, 0.0), length), min(max(middle + half, 0.0), length)
            one, other = start[2] + first * d[2], start[2] + last * d[2]
            half = np.sqrt(radius * radius - near * near)
            low, high = min(one, other) - half, max(one, other) + half
            if may_hold(rays, tile, low, high):
                tiles[count, 0], tiles[count, 1] = i, j
                count += 1
    return tiles[:count]


SAMPLES = 4
"""Points on a brick's length of material: what lies between two of them is `spare` of a brick."""
WATCHED = 8.0
"""Larger bounds are not looked into, mm."""


class Bricks(NamedTuple):
    """Cubes of side `size` from `corner` (3,) on, in the part's frame. `distance` (l, m, n): from the middle
    of a cube to the middle of the nearest one that holds material; material lies at most `spare` outside
    those; mm."""

    distance: ndarray
    corner: ndarray
    size: float
    spare: float


@njit(cache=True, nogil=True)
def mark_bricks(
    rays: RaySet, rotation: ndarray, origin: ndarray, step: int, corner: ndarray, size: float, occupied: ndarray
) -> None:
    """Set `occupied` (l, m, n) in each brick that material on every `step`-th ray either way lies in.

    The point (u, v, w) of the rays is origin + u rotation[0] + v rotation[1] + w rotation[2] in the part's
    frame.
    """
    rows, columns = rays.tile_of.shape
    place = np.empty(3)
    for i in range(step // 2, rows * TILE, step):
        for j in range(step // 2, columns * TILE, step):
            tile = rays.tile_of[i // TILE, j // TILE]
            if tile < 0:
                continue
            ray = (j % TILE) * TILE + i % TILE
            u, v = (i + 0.5) * rays.cell, (j + 0.5) * rays.cell
            for k in range(3):
                place[k] = (origin[k] + u * rotation[0, k] + v * rotation[1, k] - corner[k]) / size
            for m in range(rays.counts[tile, ray]):
                low, high = rays.spans[tile, ray, 2 * m], rays.spans[tile, ray, 2 * m + 1]
                points = int(np.ceil((high - low) * SAMPLES / size)) + 1
                for n in range(points):
                    w = (low + (high - low) * n / max(points - 1, 1)) / size
                    a = int(place[0] + w * rotation[2, 0])
                    b = int(place[1] + w * rotation[2, 1])
                    c = int(place[2] + w * rotation[2, 2])
                    occupied[a, b, c] = True


@njit(cache=True, nogil=True)
def material_distance(bricks: Bricks, x: float, y: float, z: float) -> float:
    """A lower bound of the distance of a point (part's frame) from the material, mm.

    Of a point outside the box of the bricks, at distance o from the box's nearest point q, no material is
    nearer than sqrt(o^2 + d(q)^2), because the box is convex.
    """
    place = (x - bricks.corner[0], y - bricks.corner[1], z - bricks.corner[2])
    outside, off = 0.0, 0.0
    i, j, k = 0, 0, 0
    for axis in range(3):
        count = bricks.distance.shape[axis]
        inside = min(max(place[axis], 0.0), count * bricks.size)
        outside += (place[axis] - inside) ** 2
        index = min(int(inside / bricks.size), count - 1)
        off += (inside - (index + 0.5) * bricks.size) ** 2
        if axis == 0:
            i = index
        elif axis == 1:
            j = index
        else:
            k = index
    half_diagonal = bricks.size * np.sqrt(0.75)
    to_material = max(bricks.distance[i, j, k] - half_diagonal - bricks.spare - np.sqrt(off), 0.0)
    return np.sqrt(outside + to_material * to_material)


@njit(cache=True, nogil=True)
def bound_clearances(
    starts: ndarray,
    ends: ndarray,
    start_axes: ndarray,
    end_axes: ndarray,
    sections: ndarray,
    watched: ndarray,
    bricks: Bricks,
    bounds: ndarray,
    near: ndarray,
) -> None:
    """Write lower bounds of the distance (mm) between material and each section over each piece of a move
    into `bounds` (n, s), and the heights between which material may be nearer than `watched` (s,) into `near`
    (n, s, 2).

    Pieces as in `sweep.Pieces`, in the part's frame. `sections` (s, 4): from, to, radius at either; cones are
    taken as the cylinders that hold them. A cylinder lies in the balls about points of its axis that reach half-way
    to the next; over the piece it moves by half of what it travels at most from its middle.
    """
    for i in range(len(bounds)):
        shift, turn = distance(ends[i], starts[i]) / 2, distance(end_axes[i], start_axes[i]) / 2
        x = (starts[i, 0] + ends[i, 0]) / 2
        y = (starts[i, 1] + ends[i, 1]) / 2
        z = (starts[i, 2] + ends[i, 2]) / 2
        a = start_axes[i, 0] + end_axes[i, 0]
        b = start_axes[i, 1] + end_axes[i, 1]
        c = start_axes[i, 2] + end_axes[i, 2]
        size = length((a, b, c))
        a, b, c = a / size, b / size, c / size
        for s in range(len(sections)):
            start, end = sections[s, 0], sections[s, 1]
            radius = max(sections[s, 2], sections[s, 3])
            steps = max(1, int(np.ceil(2.0 * (end - start) / radius)))
            step = (end - start) / steps
            ball = np.sqrt(radius * radius + step * step / 4)
            least = np.inf
            for both in range(2):
                # first the bound, then the heights at which it may be met
                for m in range(steps):
                    u = start + (m + 0.5) * step
                    free = material_distance(bricks, x + u * a, y + u * b, z + u * c)
                    free -= ball + shift + turn * np.hypot(u + step / 2, radius)
                    if both == 0:
                        least = min(least, free)
                    elif free <= watched[s]:
                        near[i, s, 1] = start + (m + 1) * step
                        if near[i, s, 0] < 0.0:
                            near[i, s, 0] = start + m * step
                if both == 0:
                    bounds[i, s] = least
                    near[i, s, 0] = -1.0
                    if least > watched[s]:
                        break


FULL = -1.0
"""Told instead of a length or volume where a ray has no room for one more interval."""
ALONG_U = (np.arange(TILE * TILE) % TILE + 0.5).astype(np.float64)
ALONG_V = (np.arange(TILE * TILE) // TILE + 0.5).astype(np.float64)
"""Where the rays of a tile lie, in cells from its corner."""


@inner_njit()
def _cut_ray(spans: ndarray, counts: ndarray, ray: int, start: float, end: float) -> float:
    """Take [start, end] out of a ray of a tile; the length of material that was there, or FULL."""
    count = counts[ray]
    removed = 0.0
    k = 0
    while k < count:
        low, high = spans[ray, 2 * k], spans[ray, 2 * k + 1]
        if high <= start + ROUNDING:
            k += 1
            continue
        if low >= end - ROUNDING:
            break
        keeps_low, keeps_high = start - low > SLIVER, high - end > SLIVER
        if keeps_low and keeps_high:
            if 2 * count == spans.shape[1]:
                return FULL
            for j in range(2 * count - 1, 2 * k, -1):
                spans[ray, j + 2] = spans[ray, j]
            spans[ray, 2 * k + 1], spans[ray, 2 * k + 2] = start, end
            count += 1
            removed += end - start
            break
        if keeps_low:
            spans[ray, 2 * k + 1] = start
            removed += high - start
            k += 1
        elif keeps_high:
            spans[ray, 2 * k] = end
            removed += end - low
            break
        else:
            for j in range(2 * k, 2 * count - 2):
                spans[ray, j] = spans[ray, j + 2]
            count -= 1
            removed += high - low
    counts[ray] = count
    return removed


@inner_njit(fastmath=CONTRACT)
def tile_chords(
    u: float, v: float, cell: float, d: ndarray, length: float, radius: float, lows: ndarray, highs: ndarray
) -> None:
    """Write where each ray of the tile whose corner is at (u, v) from a capsule's start lies in the capsule:
    w from its start's; the low end is infinite where a ray misses it.

    The capsule has the axis direction `d` (3,) and `length`. Where a ray enters a cylinder about the whole
    axis, t along it, it enters the capsule by the ball at the t of the capsule that is nearest: the ray's
    entry into the ball at t is a convex function of t.
    """
    dx, dy, dz = d[0], d[1], d[2]
    square = radius * radius
    across = max(1.0 - dz * dz, TINY)
    share = 1.0 / across
    for ray in range(TILE * TILE):
        x, y = u + cell * ALONG_U[ray], v + cell * ALONG_V[ray]
        along = x * dx + y * dy
        rest = along * along * dz * dz - across * (x * x + y * y - along * along - square)
        root = np.sqrt(max(rest, 0.0))
        first = min(max(along + (along * dz - root) * share * dz, 0.0), length)
        last = min(max(along + (along * dz + root) * share * dz, 0.0), length)
        near = square - (x - first * dx) * (x - first * dx) - (y - first * dy) * (y - first * dy)
        far = square - (x - last * dx) * (x - last * dx) - (y - last * dy) * (y - last * dy)
        low = first * dz - np.sqrt(max(near, 0.0))
        highs[ray] = last * dz + np.sqrt(max(far, 0.0))
        lows[ray] = low if min(rest, near) > 0.0 else np.inf


@inner_njit()
def cut_tile(rays: RaySet, tile: int, base: float, lows: ndarray, highs: ndarray) -> tuple[float, bool]:
    """Take chords, told from `base`, out of the rays of a tile: the length removed, and whether one has no
    more room.

    Balls come back to a tile that they cut: its ends and mask are set anew when one has come in vain.
    """
    removed, full = 0.0, False
    spans, counts = rays.spans[tile], rays.counts[tile]
    for ray in range(TILE * TILE):
        count = counts[ray]
        if count == 0 or lows[ray] >= highs[ray]:
            continue
        low, high = base + lows[ray], base + highs[ray]
        if high <= spans[ray, 0] or low >= spans[ray, 2 * count - 1]:
            continue
        gone = _cut_ray(spans, counts, ray, low, high)
        if gone < 0.0:
            full = True
            break
        removed += gone
    if removed > 0.0:
        rays.stale[tile] = True
    elif rays.stale[tile]:
        summarise_tile(rays, tile)
    return removed, full


@njit(cache=True, nogil=True)
def cut_capsule(rays: RaySet, start: ndarray, end: ndarray, radius: float, flat: bool) -> tuple[float, bool]:
    """Take the capsule of `radius` about the segment from `start` to `end` (u, v, w) out of the material; one
    that is `flat` ends at `end`, as flutes do.

    Returns the volume removed (mm^3), and whether a ray has no room for one more interval: then part of the
    capsule is still to be cut, and cutting it again with more room completes it.
    """
    cell = rays.cell
    side = rays.cell * TILE
    d, length = direction_of(start, end)
    lows, highs = np.empty(TILE * TILE), np.empty(TILE * TILE)
    removed = 0.0
    for i, j in tiles_reached(rays, start, end, d, length, radius):
        tile_chords(i * side - start[0], j * side - start[1], cell, d, length, radius, lows, highs)
        for ray in range(TILE * TILE if flat else 0):
            u, v = i * side - start[0] + cell * ALONG_U[ray], j * side - start[1] + cell * ALONG_V[ray]
            rest = length - u * d[0] - v * d[1]
            if d[2] > FLAT:
                highs[ray] = min(highs[ray], rest / d[2])
            elif d[2] < -FLAT:
                lows[ray] = max(lows[ray], rest / d[2])
            elif rest < 0.0:
                lows[ray] = np.inf
        in_tile, full = cut_tile(rays, np.int64(rays.tile_of[i, j]), start[2], lows, highs)
        removed += in_tile
        if full:
            return removed * cell * cell, True
    return removed * cell * cell, False


@inner_njit()
def cylinder_meets(rays: RaySet, foot: ndarray, axis: ndarray, length: float, radius: float) -> bool:
    """Whether a cylinder with flat ends, from `foot` (u, v, w) along the unit `axis`, meets material.

    A tile is left out where the ray through its middle, with all as much larger as the tile is wide, meets
    none of what stands in it.
    """
    cell = rays.cell
    side = rays.cell * TILE
    dx, dy, dz = axis[0], axis[1], axis[2]
    half_diagonal = side * np.sqrt(0.5)
    rows, columns = rays.tile_of.shape
    along_u, along_v = length * dx, length * dy
    low, high = foot[0] + min(along_u, 0.0) - radius, foot[0] + max(along_u, 0.0) + radius
    first_u, last_u = steps_between(low, high, side, rows)
    low, high = foot[1] + min(along_v, 0.0) - radius, foot[1] + max(along_v, 0.0) + radius
    first_v, last_v = steps_between(low, high, side, columns)
    wide = radius + half_diagonal
    below = -half_diagonal
    above = length + half_diagonal
    for i in range(first_u, last_u + 1):
        for j in range(first_v, last_v + 1):
            tile = rays.tile_of[i, j]
            if tile < 0 or rays.low[tile] > rays.high[tile]:
                continue
            x, y = (i + 0.5) * side - foot[0], (j + 0.5) * side - foot[1]
            enter, leave = cylinder_chord(x, y, dx, dy, dz, below, above, wide)
            low, high = foot[2] + enter, foot[2] + leave
            if low >= high or not may_hold(rays, tile, low, high):
                continue
            for ray in range(TILE * TILE):
                x = (i * TILE + ALONG_U[ray]) * cell - foot[0]
                y = (j * TILE + ALONG_V[ray]) * cell - foot[1]
                enter, leave = cylinder_chord(x, y, dx, dy, dz, 0.0, length, radius)
                low, high = foot[2] + enter + ROUNDING, foot[2] + leave - ROUNDING
                for k in range(rays.counts[tile, ray]):
                    if max(low, rays.spans[tile, ray, 2 * k]) < min(high, rays.spans[tile, ray, 2 * k + 1]):
                        return True
    return False


FINE = 5
"""A search disc is first looked at on rays this many to its radius, then on all rays about the best one."""
STEEPEST = 1.5
"""Ends on neighbouring rays are of one face of the material where they differ by this many cells at most: of three sets
that cross, one meets each face so."""


@inner_njit()
def _ray_at(rays: RaySet, i: int, j: int) -> tuple[int, int]:
    """The tile of ray (i, j) and the ray's index in it; the tile is negative where there is no such ray, or never was
    material on it."""
    rows, columns = rays.tile_of.shape
    if i < 0 or j < 0 or i >= rows * TILE or j >= columns * TILE:
        return -1, 0
    return rays.tile_of[i // TILE, j // TILE], (j % TILE) * TILE + i % TILE


@inner_njit()
def _interval(rays: RaySet, i: int, j: int, w: float) -> tuple[float, float]:
    """The interval of material that holds w on ray (i, j); the first end is larger where w is in air."""
    tile, ray = _ray_at(rays, i, j)
    for k in range(rays.counts[tile, ray] if tile >= 0 else 0):
        low, high = rays.spans[tile, ray, 2 * k], rays.spans[tile, ray, 2 * k + 1]
        if low <= w <= high:
            return low, high
    return 1.0, 0.0


@inner_njit()
def _on_ray(rays: RaySet, i: int, j: int, u: float, v: float, w: float) -> float:
    """Squared distance from (u, v, w) to the nearest air on ray (i, j)."""
    x, y = (i + 0.5) * rays.cell - u, (j + 0.5) * rays.cell - v
    low, high = _interval(rays, i, j, w)
    along = min(w - low, high - w) if low <= high else 0.0
    return x * x + y * y + along * along


@inner_njit()
def _end_beside(rays: RaySet, i: int, j: int, w: float, high: bool) -> float:
    """The upper (`high`) or lower end of material on ray (i, j) that continues a face from height w; NaN where none
    does."""
    tile, ray = _ray_at(rays, i, j)
    for k in range(rays.counts[tile, ray] if tile >= 0 else 0):
        end = rays.spans[tile, ray, 2 * k + high]
        if abs(end - w) <= STEEPEST * rays.cell:
            return end
    return np.nan


@inner_njit()
def _on_face(rays: RaySet, i: int, j: int, u: float, v: float, w: float) -> float:
    """Squared distance from (u, v, w) to the nearest of the triangles between the nearer end of the material on ray
    (i, j) and those beside it; infinite where there are none, or the ray is in air."""
    cell = rays.cell
    low, high = _interval(rays, i, j, w)
    if low > high:
        return np.inf
    upper = high - w < w - low
    corners = np.empty(9)
    corners[0], corners[1], corners[2] = (i + 0.5) * cell, (j + 0.5) * cell, high if upper else low
    corners[4], corners[6] = corners[1], corners[0]
    before = _end_beside(rays, i, j - 1, corners[2], upper)
    behind = _end_beside(rays, i, j + 1, corners[2], upper)
    best = np.inf
    for a in (-1, 1):
        corners[3], corners[5] = corners[0] + a * cell, _end_beside(rays, i + a, j, corners[2], upper)
        for b, end in ((-1, before), (1, behind)):
            corners[7], corners[8] = corners[1] + b * cell, end
            if not (np.isnan(corners[5]) or np.isnan(end)):
                best = min(best, squared_triangle_distance((u, v, w), corners))
    return best


@njit(cache=True, nogil=True)
def _nearest(rays: RaySet, u: float, v: float, w: float, best: float) -> float:
    """The smaller of `best` and the squared distance from (u, v, w) to air, found on one set: on its rays, then on the
    face between the ends about the nearest one."""
    cell = rays.cell
    i, j = int(np.floor(u / cell)), int(np.floor(v / cell))
    near = _on_ray(rays, i, j, u, v, w)
    at_i, at_j = i, j
    step = max(int(np.sqrt(min(near, best)) / (FINE * cell)), 1)
    count = int(np.sqrt(min(near, best)) / (step * cell)) + 1
    for a in range(-count, count + 1):
        for b in range(-count, count + 1):
            if (a * a + b * b) * (step * cell) ** 2 > 2 * min(near, best):
                continue
            squared = _on_ray(rays, i + a * step, j + b * step, u, v, w)
            if squared < near:
                near = squared
                at_i = i + a * step
                at_j = j + b * step
    middle_i, middle_j = at_i, at_j
    for a in range(1 - step, step):
        for b in range(1 - step, step):
            squared = _on_ray(rays, middle_i + a, middle_j + b, u, v, w)
            if squared < near:
                near = squared
                at_i = middle_i + a
                at_j = middle_j + b
    return min(best, near, _on_face(rays, at_i, at_j, u, v, w))


@inner_njit()
def air_on_set(rays: RaySet, u: float, v: float, w: float) -> float:
    """Distance from (u, v, w) to the nearest air on one set, mm; 0 on a ray in air."""
    return np.sqrt(_nearest(rays, u, v, w, np.inf))


@njit(cache=True, nogil=True)
def air_distances(x_rays: RaySet, y_rays: RaySet, z_rays: RaySet, points: ndarray, found: ndarray) -> None:
    """Write the distance of each point (n, 3) (grid's coordinates) from the nearest air into `found` (n,),
    mm; in air that to a ray, half of the diagonal of a cell at most."""
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        best = _nearest(x_rays, y, z, x, np.inf)
        best = _nearest(y_rays, z, x, y, best)
        best = _nearest(z_rays, x, y, z, best)
        found[n] = np.sqrt(best)


@njit(cache=True, nogil=True)
def in_material(x_rays: RaySet, y_rays: RaySet, z_rays: RaySet, points: ndarray, found: ndarray) -> None:
    """Write whether each point lies in material, as two sets of the three tell, into `found` (n,)."""
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        votes = 0
        for rays, u, v, w in ((x_rays, y, z, x), (y_rays, z, x, y), (z_rays, x, y, z)):
            low, high = _interval(rays, int(np.floor(u / rays.cell)), int(np.floor(v / rays.cell)), w)
            votes += low <= high
        found[n] = votes >= 2


@njit(cache=True, nogil=True)
def new_ends(now: RaySet, before: RaySet, step: int) -> ndarray:
    """The ends (u, v, w) of the material on every `step`-th ray either way that were no ends before."""
    ends = np.empty((1024, 3))
    count = 0
    rows, columns = now.tile_of.shape
    for i in range(step // 2, rows * TILE, step):
        for j in range(step // 2, columns * TILE, step):
            tile = now.tile_of[i // TILE, j // TILE]
            if tile < 0:
                continue
            ray = (j % TILE) * TILE + i % TILE
            for k in range(2 * now.counts[tile, ray]):
                w = now.spans[tile, ray, k]
                known = False
                for m in range(2 * before.counts[tile, ray]):
                    known = known or before.spans[tile, ray, m] == w
                if known:
                    continue
                if count == len(ends):
                    larger = np.empty((2 * count, 3))
                    for m in range(count):
                        for n in range(3):
                            larger[m, n] = ends[m, n]
                    ends = larger
                ends[count, 0], ends[count, 1], ends[count, 2] = ((i + 0.5) * now.cell, (j + 0.5) * now.cell, w)
                count += 1
    return ends[:count]


class ProbesByCell(NamedTuple):
    """Normal probes at `points` (n, 3) along unit `normals` in the order of their cells (i, j, k) of a grid of cubes of
    side `size` (mm) from `corner` on: those of a cell begin at cell_starts[i, j, k] and end where those of the next one
    begin."""

    points: ndarray
    normals: ndarray
    cell_starts: ndarray
    corner: ndarray
    size: float


class Capsules(NamedTuple):
    """Capsules of `radii` (c,) about the segments from `starts` to `ends` (c, 3), mm, and their `names` (c,)."""

    starts: ndarray
    ends: ndarray
    radii: ndarray
    names: ndarray


@inner_njit()
def _ball(p: Three, n: ndarray, square: float) -> tuple[float, float]:
    """Where a line through p, told from the ball's centre, along the unit n lies in the ball."""
    along = dot(p, n)
    rest = square - (dot(p, p) - along * along)
    if rest <= 0.0:
        return np.inf, -np.inf
    half = np.sqrt(rest)
    return -along - half, -along + half


@inner_njit()
def line_chord(p: ndarray, n: ndarray, start: ndarray, end: ndarray, radius: float) -> tuple[float, float]:
    """Where the line p + t n, n being unit, lies in a capsule: t; the first is larger where it misses."""
    square = radius * radius
    from_start = minus(p, start)
    way = minus(end, start)
    low, high = _ball(from_start, n, square)
    size = length(way)
    if size <= 0.0:
        return low, high
    first, last = _ball(minus(from_start, way), n, square)
    low, high = min(low, first), max(high, last)
    d = way[0] / size, way[1] / size, way[2] / size
    turn = dot(n, d)
    along = dot(from_start, d)
    across = 1.0 - turn * turn
    if across > TINY:
        half = dot(from_start, n) - along * turn
        rest = half * half - across * (dot(from_start, from_start) - along * along - square)
        if rest > 0.0:
            root = np.sqrt(rest)
            first, last = (-half - root) / across, (-half + root) / across
            if 0.0 <= along + first * turn <= size:
                low = min(low, first)
            if 0.0 <= along + last * turn <= size:
                high = max(high, last)
    return low, high


@inner_njit()
def cells_near(
    start: ndarray, end: ndarray, radius: float, reach: float, probes: ProbesByCell, low: ndarray, high: ndarray
) -> bool:
    """Write the first and the last cell each way that a capsule and what is within `reach` (mm) of it meet; whether it
    meets any."""
    meets = True
    for k in range(3):
        least = min(start[k], end[k]) - radius - reach - probes.corner[k]
        most = max(start[k], end[k]) + radius + reach - probes.corner[k]
        low[k], high[k] = steps_between(least, most, probes.size, probes.cell_starts.shape[k] - (k == 2))
        meets = meets and low[k] <= high[k]
    return meets


@njit(cache=True, nogil=True)
def cut_normal_probes(
    probes: ProbesByCell, reach: float, capsules: Capsules, heights: ndarray, owners: ndarray, from_top: bool
) -> None:
    """Lower `heights` (n,) to where capsules cut the normal probes, and set `owners` (n,) to the name of the one that
    did. `from_top`: only a capsule that holds the normal probe's upper end cuts it; what would hang over a cut stands.
    Cuts more than `reach` above the surface are left out.
    """
    points, normals, cell_starts, _, _ = probes
    starts, ends, radii, names = capsules
    shape = cell_starts.shape
    flat = cell_starts.ravel()
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for c in range(len(starts)):
        radius = radii[c]
        if not cells_near(starts[c], ends[c], radius, reach, probes, low, high):
            continue
        half = 0.0
        mx = (starts[c, 0] + ends[c, 0]) / 2
        my = (starts[c, 1] + ends[c, 1]) / 2
        mz = (starts[c, 2] + ends[c, 2]) / 2
        for k in range(3):
            half += (ends[c, k] - starts[c, k]) ** 2 / 4
        ball = radius + np.sqrt(half)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                row = (i * shape[1] + j) * shape[2]
                for m in range(flat[row + low[2]], flat[row + high[2] + 1]):
                    # no point of the capsule is nearer to the nail's foot than this ball about its middle
                    far = (points[m, 0] - mx) ** 2 + (points[m, 1] - my) ** 2 + (points[m, 2] - mz) ** 2
                    if far >= (ball + max(heights[m], 0.0)) ** 2:
                        continue
                    enter, leave = line_chord(points[m], normals[m], starts[c], ends[c], radius)
                    lowest = heights[m] if from_top else 0.0
                    if enter < leave and leave > lowest and enter < heights[m]:
                        height = (
                            enter
                            if enter > 0.0
                            else np.sqrt(squared_segment_distance(points[m], starts[c], ends[c])) - radius
                        )
                        if height < heights[m]:
                            heights[m] = height
                            owners[m] = names[c]


@njit(cache=True, nogil=True)
def useful_moves(
    probes: ProbesByCell, starts: ndarray, ends: ndarray, radius: float, least: float, heights: ndarray
) -> ndarray:
    """Whether each move (m,) lowers a normal probe by `least` at least, after those before it that do; they lower
    `heights` (n,). The normal probes are cut from the top."""
    points, normals, cell_starts, _, _ = probes
    reach = radius + heights.max()
    shape = cell_starts.shape
    flat = cell_starts.ravel()
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    useful = np.zeros(len(starts), dtype=np.bool_)
    for c in range(len(starts)):
        if not cells_near(starts[c], ends[c], reach, 0.0, probes, low, high):
            continue
        for lowers in (False, True):
            for i in range(low[0], high[0] + 1):
                for j in range(low[1], high[1] + 1):
                    row = (i * shape[1] + j) * shape[2]
                    for m in range(flat[row + low[2]], flat[row + high[2] + 1]):
                        enter, leave = line_chord(points[m], normals[m], starts[c], ends[c], radius)
                        height = max(enter, 0.0)
                        if enter >= leave or leave <= heights[m] or height >= heights[m]:
                            continue
                        if lowers:
                            heights[m] = height
                        elif heights[m] - height >= least:
                            useful[c] = True
            if not useful[c]:
                break
    return useful


def probe_cells(points: ndarray, size: float) -> tuple[ndarray, ndarray, ndarray]:
    """The order (n,) of points (n, 3) by cells of side `size`, where each cell begins in it, and the corner of
    the first cell: as `ProbesByCell` has them."""
    corner = points.min(0)
    cells = np.floor((points - corner) / size).astype(np.int64)
    shape = cells.max(0) + 1
    flat = np.ravel_multi_index(tuple(cells.T), tuple(shape))
    counts = np.bincount(flat, minlength=int(shape.prod()))
    ends = np.cumsum(counts).reshape(tuple(shape))
    first = np.zeros((shape[0], shape[1], shape[2] + 1), dtype=np.int64)
    first[:, :, 1:] = ends
    first[:, :, 0] = np.r_[0, ends[:, :, -1].ravel()[:-1]].reshape(shape[0], shape[1])
    return np.argsort(flat, kind="stable"), first, corner


ROWS = 24
"""Cells from the tip to the ball's equator. With TURN about the axis the mean force of a demo is 0.2 % off that of 60 x
180 cells, its mean peak 1 %."""
TURN = 72
"""Cells about the axis: a multiple of 2, 3 and 4 flutes."""
COARSER = 3.0
"""Cells of the flutes are at most so many times as high as those of the ball: walls that reach them are even."""
_KAPPA = (np.arange(ROWS) + 0.5) * 0.5 * np.pi / ROWS
_KAPPA_COSINES = np.cos(_KAPPA)
_KAPPA_SINES = np.sin(_KAPPA)
_PHI = (np.arange(TURN) + 0.5) * 2 * np.pi / TURN
_COSINES = np.cos(_PHI)
_SINES = np.sin(_PHI)


class Edges(NamedTuple):
    """The edges of the ball on n pieces of moves, in the coordinates of one set of rays, and what they find there.

    `frames` (n, 3, 3): e_1 (across the axis, towards the feed), e_2 = a x e_1 and the axis a; `centres` (n, 3): middle
    of the ball's centre line, moved ahead; `feeds` (n, 2): the unit feed along e_1 and a; `chips` (n,): feed a tooth
    fz, mm, 0 for a piece that is not asked; `coefficients` (6,): Ktc, Krc, Kac (N/mm^2), Kte, Kre, Kae (N/mm).
    `forces` (n, TURN, 3): that of one edge at each phi along v, e_r and a, N; `engaged` (n, 5): length of the edge,
    summed over the turn, with that times the place along e_1, e_2 and a from `centres` (mm, mm^2), and the area across
    the feed (mm^2); `asked` (n,): the piece has been.
    """

    frames: ndarray
    centres: ndarray
    feeds: ndarray
    chips: ndarray
    coefficients: ndarray
    forces: ndarray
    engaged: ndarray
    asked: ndarray


@njit(cache=True, nogil=True, inline="always")
def _meets(
    rays: RaySet, u: float, v: float, centre: ndarray, axis: ndarray, radius: float, flutes: bool, upper: bool
) -> bool:
    """Whether the upper or lower side of a ball, or of the cylinder of its `flutes`, lies in material on the ray
    nearest to (u, v)."""
    i, j = int(np.floor(u / rays.cell)), int(np.floor(v / rays.cell))
    # the square of the distance from the centre, or from the axis, is square + 2 t slope + t^2 steep on the ray
    x, y = (i + 0.5) * rays.cell - centre[0], (j + 0.5) * rays.cell - centre[1]
    along = x * axis[0] + y * axis[1] if flutes else 0.0
    rise = axis[2] if flutes else 0.0
    square = x * x + y * y - along * along
    slope = -along * rise
    steep = 1.0 - rise * rise
    rest = slope * slope - steep * (square - radius * radius)
    if rest <= 0.0:
        return False
    at = centre[2] + (np.sqrt(rest) if upper else -np.sqrt(rest)) / steep - slope / steep
    low, high = _interval(rays, i, j, at)
    return low <= high


@inner_njit()
def engage(rays: RaySet, edges: Edges, i: int, radius: float, reach: float) -> None:
    """Ask this set of rays for the cells of piece `i` that lie most along it; flutes up to `reach` (mm) above the
    ball's centre. A piece that is asked again, when a ray had no more room, keeps its first answer."""
    if edges.asked[i] or edges.chips[i] <= 0.0:
        return
    edges.asked[i] = True
    one = edges.frames[i, 0]
    two = edges.frames[i, 1]
    axis = edges.frames[i, 2]
    centre = edges.centres[i]
    if reach <= 0.0 and len(tiles_reached(rays, centre, centre, axis, 0.0, radius)) == 0:
        return
    inner = radius - ROUNDING
    db = radius * 0.5 * np.pi / ROWS
    flutes = int(np.ceil(reach / max(COARSER * db, rays.cell)))
    ahead = edges.feeds[i, 0]
    up = edges.feeds[i, 1]
    chip = edges.chips[i]
    a_u, a_v, a_w = axis
    ktc, krc, kac, kte, kre, kae = edges.coefficients
    for k in range(TURN):
        e_u = _COSINES[k] * one[0] + _SINES[k] * two[0]
        e_v = _COSINES[k] * one[1] + _SINES[k] * two[1]
        e_w = _COSINES[k] * one[2] + _SINES[k] * two[2]
        along_e = _COSINES[k] * ahead
        way, radial, axial, edge, out, level, area = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for row in range(ROWS + flutes):
            sine, cosine, height, length = 1.0, 0.0, 0.0, db
            if row < ROWS:
                sine, cosine = _KAPPA_SINES[row], _KAPPA_COSINES[row]
            else:
                height = (row - ROWS + 0.5) * reach / flutes
                length = reach / flutes
            along = sine * along_e - cosine * up
            if along <= 0.0:
                continue
            nu, nv, nw = sine * e_u - cosine * a_u, sine * e_v - cosine * a_v, sine * e_w - cosine * a_w
            # of two that lie as much along it one set is asked, going round u, v, w
            if abs(nw) < abs(nu) or abs(nw) <= abs(nv):
                if row >= ROWS:
                    break  # the flutes have one normal
                continue
            u, v = centre[0] + radius * nu + height * a_u, centre[1] + radius * nv + height * a_v
            if not _meets(rays, u, v, centre, axis, inner, row >= ROWS, nw > 0.0):
                continue
            normal, meridian = krc * chip * along + kre, kac * chip * along + kae
            way += length * (ktc * chip * along + kte)
            radial += length * (normal * sine + meridian * cosine)
            axial += length * (meridian * sine - normal * cosine)
            edge += length
            out += length * sine
            level += length * (height - radius * cosine)
            area += length * along * sine
        if edge > 0.0:
            edges.forces[i, k, 0] = way
            edges.forces[i, k, 1] = radial
            edges.forces[i, k, 2] = axial
            edges.engaged[i, 0] += edge
            edges.engaged[i, 1] += out * radius * _COSINES[k]
            edges.engaged[i, 2] += out * radius * _SINES[k]
            edges.engaged[i, 3] += level
            edges.engaged[i, 4] += area * radius * 2 * np.pi / TURN


@njit(cache=True, nogil=True)
def over_turns(forces: ndarray, frames: ndarray, flutes: int, means: ndarray, peaks: ndarray) -> None:
    """Write the mean force over a turn and the largest one (n, 3) of a cutter with so many `flutes`, N, in the frame of
    `frames` (n, 3, 3); `forces` (n, TURN, 3) is that of one edge, as in Edges."""
    share = TURN // flutes
    total = np.empty((TURN, 3))
    for i in range(len(forces)):
        for c in range(3):
            means[i, c] = peaks[i, c] = 0.0
        for k in range(TURN):
            cosine, sine = _COSINES[k], _SINES[k]
            t, r, a = forces[i, k]
            for c in range(3):
                one, two = frames[i, 0, c], frames[i, 1, c]
                total[k, c] = t * (sine * one - cosine * two) + r * (cosine * one + sine * two) + a * frames[i, 2, c]
                means[i, c] += flutes * total[k, c] / TURN
        largest = 0.0
        for k in range(share):
            x, y, z = 0.0, 0.0, 0.0
            for flute in range(flutes):
                x += total[k + flute * share, 0]
                y += total[k + flute * share, 1]
                z += total[k + flute * share, 2]
            size = x * x + y * y + z * z
            if size > largest:
                largest = size
                peaks[i, 0], peaks[i, 1], peaks[i, 2] = x, y, z
