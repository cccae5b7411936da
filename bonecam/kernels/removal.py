"""Removal, compiled: the moves of a program through the material of one set of rays, in their order, what tools would
remove from material that stays as it is, and how far the whole tool stays from what is never cut: the table's plane,
and upright cylinders that stand for chuck, table and what stands on it.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.bodies import (
    Ways,
    column_distance,
    cut_flutes,
    deepest_end,
    flutes_meet,
    frustum_clearance,
    piece_pose,
    travel_of,
)
from bonecam.kernels.distances import from_column
from bonecam.kernels.rays import TILE, Edges, RaySet, cut_capsule, direction_of, engage, tile_chords, tiles_reached

SETS = 3
"""Sets of rays."""
TOOL_STEP = 0.05
"""Shank, holder and spindle stand this far apart (mm), or an eighth of their distance, where that is taken: what lies
between is nearer by 1/500 of the distance, of a straight way past a point."""


class Pieces(NamedTuple):
    """Straight pieces of moves of one tool, in the coordinates of the rays.

    Piece i runs from `starts` to `ends` (n, 3) of the ball's centre, while the axis turns from `start_axes`
    to `end_axes`; `moves` (n,) is the move it belongs to. `reach` (n,): height above the ball's centre up to
    which the flutes may meet material, 0 for none. `probed` (n,): its depth is measured. `bounds` (n, s): lower
    bounds of the distance of each section above the flutes from material, `near` (n, s, 2): the heights between
    which that is nearest; mm.
    """

    starts: ndarray
    ends: ndarray
    start_axes: ndarray
    end_axes: ndarray
    moves: ndarray
    reach: ndarray
    probed: ndarray
    bounds: ndarray
    near: ndarray


class SweepResult(NamedTuple):
    """What a sweep finds. `volumes` (moves,): removed by each move, mm^3; `depths` (moves,): how deep probed moves
    cut, mm. `least` (3,): least distance of shank, holder and spindle from material so far, mm; `where` (3,): its
    move. `touched` (3,): first move in which the distance is below the one allowed, -1 for none; nothing is measured
    after it."""

    volumes: ndarray
    depths: ndarray
    least: ndarray
    where: ndarray
    touched: ndarray


@inner_njit()
def ways_of(pieces: Pieces) -> Ways:
    """The pieces as ways of the tool, of the one kind for which what takes these is compiled."""
    return Ways(pieces.starts, pieces.ends, pieces.start_axes, pieces.end_axes, pieces.reach)


@inner_njit()
def _capsule_depth(rays: RaySet, start: ndarray, end: ndarray, radius: float) -> float:
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
        deepest = max(deepest, deepest_end(rays, i, j, start[2], lows, highs))
    return deepest


@njit(cache=True, nogil=True)
def _clearance(
    rays: RaySet, ways: Ways, i: int, bounds: ndarray, section: ndarray, least: float, foot: ndarray, axis: ndarray
) -> float:
    """The distance that a section keeps from material over a way, or `least` where it is more; material may be nearer
    between the heights `bounds` (2,) alone. Measured are poses along the way, which come closer while half of the way
    from one to the next may bring it below `least`."""
    low, high = bounds[0], bounds[1]
    taper = (section[3] - section[2]) / (section[1] - section[0])
    radius = section[2] + taper * (low - section[0])
    travel = travel_of(ways, i, np.hypot(high, max(section[2], section[3])))
    step = max(travel, TOOL_STEP)
    while True:
        steps = max(int(np.ceil(travel / step)), 1)
        slack = travel / steps / 2
        near = least + slack
        for k in range(steps):
            piece_pose(ways, i, (k + 0.5) / steps, foot, axis)
            near = min(near, frustum_clearance(rays, foot, axis, low, high, radius, taper, near))
            if near < -slack:
                break
        if near - slack >= least or step <= max(TOOL_STEP, near / 8):
            return min(near, least)
        step = max(TOOL_STEP, step / 4)


@njit(cache=True, nogil=True)
def sweep(
    rays: RaySet,
    pieces: Pieces,
    radius: float,
    sections: ndarray,
    parts: ndarray,
    allowed: float,
    first: int,
    found: SweepResult,
    turn: int,
    edges: Edges,
) -> int:
    """Take what ball and flutes sweep out of the material, piece by piece from `first` on, and measure the sections
    above them against what stands then; returns the piece at which a ray has no room for one more interval, or
    the number of pieces.

    `sections` (s, 4): from, to, radius at either; `parts` (s,): 0 for the shank, 1 for the holder, 2 for the
    spindle; `allowed` is the signed distance (mm) that they may have. Each of the SETS of rays measures every
    third piece, from piece `turn` on. `edges` has a row a piece that is asked what the ball's edge engages before it is
    cut, or none at all.
    """
    foot, axis, top = np.empty(3), np.empty(3), np.empty(3)
    ways = ways_of(pieces)
    for i in range(first, len(pieces.starts)):
        if pieces.probed[i]:
            depth = _capsule_depth(rays, pieces.starts[i], pieces.ends[i], radius)
            found.depths[pieces.moves[i]] = max(found.depths[pieces.moves[i]], depth)
        if len(edges.chips):
            engage(rays, edges, i, radius, pieces.reach[i])
        volume, full = cut_capsule(rays, pieces.starts[i], pieces.ends[i], radius, np.bool_(False))
        found.volumes[pieces.moves[i]] += volume
        if full:
            return i
        volume, full = cut_flutes(rays, ways, i, radius, foot, axis, top)
        found.volumes[pieces.moves[i]] += volume
        if full:
            return i
        for s in range(len(sections) if i % SETS == turn else 0):
            part = parts[s]
            if found.touched[part] >= 0 or pieces.bounds[i, s] >= found.least[part]:
                continue
            near = _clearance(rays, ways, i, pieces.near[i, s], sections[s], found.least[part], foot, axis)
            if near < allowed:
                found.touched[part] = pieces.moves[i]
            if near < found.least[part]:
                found.least[part] = near
                found.where[part] = pieces.moves[i]
    return len(pieces.starts)


@inner_njit()
def _add_tiles(rays: RaySet, start: ndarray, end: ndarray, radius: float, tiles: ndarray, count: int) -> int:
    """Add the tiles that a capsule may reach to the first `count` of `tiles`; their number then."""
    d, length = direction_of(start, end)
    for a, b in tiles_reached(rays, start, end, d, length, radius):
        tile = rays.tile_of[a, b]
        known = False
        for k in range(count):
            known = known or tiles[k] == tile
        if not known:
            tiles[count] = tile
            count += 1
    return count


@inner_njit()
def _cut(
    rays: RaySet, ways: Ways, i: int, radius: float, foot: ndarray, axis: ndarray, top: ndarray
) -> tuple[float, bool]:
    """Take what ball and flutes sweep on way `i` out of the material: the volume (mm^3), and whether a ray has no more
    room."""
    volume, full = cut_capsule(rays, ways.starts[i], ways.ends[i], radius, np.bool_(False))
    if full:
        return volume, True
    by_flutes, full = cut_flutes(rays, ways, i, radius, foot, axis, top)
    return volume + by_flutes, full


@inner_njit()
def _copy_tile(source: RaySet, tile: int, target: RaySet, place: int) -> None:
    """Copy a tile of one set to the place of a tile of another."""
    for ray in range(source.spans.shape[1]):
        target.counts[place, ray] = source.counts[tile, ray]
        for k in range(source.spans.shape[2]):
            target.spans[place, ray, k] = source.spans[tile, ray, k]
    target.low[place], target.high[place] = source.low[tile], source.high[tile]
    target.mask[place], target.stale[place] = source.mask[tile], source.stale[tile]


@njit(cache=True, nogil=True)
def probe(rays: RaySet, ways: Ways, ends: ndarray, gone: ndarray, radius: float, first: int, volumes: ndarray) -> int:
    """Write what a tool would remove on the ways of each line into `volumes` (k,), mm^3, from line `first` on; returns
    the line at which a ray has no room for one more interval, or their number.

    The ways of line i end before `ends` (k,) i; what is removed on those before `gone` (k,) i is taken as gone before
    the line is.
    """
    foot, axis, top = np.empty(3), np.empty(3), np.empty(3)
    tiles = np.empty(len(rays.counts), dtype=np.int64)
    for i in range(first, len(ends)):
        start = ends[i - 1] if i else 0
        # the tiles that the tool may reach on the ways of the line
        count: Any = np.int64(0)  # a literal would have `_add_tiles` compiled once more
        for way in range(start, ends[i]):
            count = _add_tiles(rays, ways.starts[way], ways.ends[way], radius, tiles, count)
            if ways.reach[way] <= 0.0 or not flutes_meet(rays, ways, way, radius, foot, axis):
                continue
            half = travel_of(ways, way, ways.reach[way]) / 2
            for k in range(3):
                top[k] = foot[k] + (ways.reach[way] + 2 * half) * axis[k]
            count = _add_tiles(rays, foot, top, radius + half, tiles, count)

        # they are kept while the tool cuts
        spans = np.empty((count, rays.spans.shape[1], rays.spans.shape[2]), dtype=np.float32)
        counts = np.empty((count, rays.counts.shape[1]), dtype=np.uint8)
        mask, stale = np.empty(count, dtype=np.uint64), np.empty(count, dtype=np.bool_)
        low, high = np.empty(count), np.empty(count)
        kept = RaySet(rays.tile_of, spans, counts, low, high, mask, stale, rays.cell, rays.length)
        for k in range(count):
            _copy_tile(rays, tiles[k], kept, k)
        volumes[i] = 0.0
        full = False
        for way in range(start, ends[i]):
            removed, full = _cut(rays, ways, way, radius, foot, axis, top)
            if full:
                break
            if way >= gone[i]:
                volumes[i] += removed
        for k in range(count):
            _copy_tile(kept, k, rays, tiles[k])
        if full:
            return i
    return len(ends)


@njit(cache=True, nogil=True)
def cut_ways(rays: RaySet, ways: Ways, radius: float, first: int) -> int:
    """Take what a tool sweeps on its ways out of the material, from way `first` on; returns the way at which a ray has
    no room for one more interval, or their number."""
    foot, axis, top = np.empty(3), np.empty(3), np.empty(3)
    for i in range(first, len(ways.starts)):
        if _cut(rays, ways, i, radius, foot, axis, top)[1]:
            return i
    return len(ways.starts)


@inner_njit()
def _distance(foot: ndarray, axis: ndarray, section: ndarray, columns: ndarray, closed: bool, within: float) -> float:
    """The distance of one section from plane and cylinders, or `within`; below the plane it is negative."""
    near = within
    from_axis = foot.copy()
    if closed:
        drop = np.sqrt(max(1.0 - axis[2] * axis[2], 0.0))
        for side in range(2):
            near = min(near, foot[2] + section[side] * axis[2] - section[2 + side] * drop)
    for c in range(len(columns)):
        if near > 0.0:
            from_axis[0], from_axis[1] = foot[0] - columns[c, 3], foot[1] - columns[c, 4]
            near = min(near, column_distance(from_axis, axis, section, columns[c], near))
    return near


@njit(cache=True, nogil=True)
def fixed_clearance(
    pieces: Pieces, sections: ndarray, radius: float, columns: ndarray, closed: bool, within: float
) -> tuple[float, int, int, int]:
    """The least distance (mm) of the tool from the fixed bodies over all pieces, the piece and the section where it
    is (-1: more than `within`), and the first piece in which they meet (-1: none does).

    `sections` (s, 4): from, to, radius at either, told from the ball's centre; number s is the ball of `radius`.
    `columns` (c, 5): radius, z of top and bottom, x and y; `closed`: nothing may be below z = 0. Told is the distance
    at poses a TOOL_STEP or an eighth of it apart, where half of the way from one to the next may bring it below the
    least.
    """
    foot, axis = np.empty(3), np.empty(3)
    ways = ways_of(pieces)
    least = within
    where = -1
    what = -1
    touched = -1
    for i in range(len(pieces.starts)):
        for s in range(len(sections) + 1):
            ball = s == len(sections)
            reach = 0.0
            if not ball:
                reach = np.hypot(sections[s, 1], max(sections[s, 2], sections[s, 3]))
            travel = travel_of(ways, i, reach)
            step = max(travel, TOOL_STEP)
            while True:
                steps = max(int(np.ceil(travel / step)), 1)
                slack = travel / steps / 2
                near = least
                bare = np.inf
                for k in range(steps):
                    piece_pose(ways, i, (k + 0.5) / steps, foot, axis)
                    if ball:
                        distance = foot[2] if closed else np.inf
                        for c in range(len(columns)):
                            distance = min(distance, from_column(foot, columns[c]))
                        distance -= radius
                    else:
                        distance = _distance(foot, axis, sections[s], columns, closed, max(near, 0.0) + slack)
                    bare = min(bare, distance)
                    near = min(near, distance - slack)
                if bare <= 0.0 or near >= least or step <= max(TOOL_STEP, near / 8):
                    break
                step = max(TOOL_STEP, step / 4)
            if bare < least:
                least, where, what = bare, i, s
            if bare <= 0.0 and touched < 0:
                touched = i
    return least, where, what, touched
