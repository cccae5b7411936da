"""The moves of a program through one set of rays, in their order, compiled."""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.removal.air import air_on_set
from bonecam.kernels.removal.body import body_depth, cut_body
from bonecam.kernels.removal.cut import cut_capsule, tile_chords
from bonecam.kernels.removal.engagement import Edges, engage
from bonecam.kernels.removal.flutes import NO_BODY, Ways, cut_flutes, piece_pose, travel_of
from bonecam.kernels.removal.frustum import frustum_clearance
from bonecam.kernels.removal.rays import TILE, RaySet, direction_of, tiles_reached

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
    which that is nearest; mm. `body` (k, 3): the cones of a bull nose, as `Cutter.body` has them.
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
    body: ndarray = NO_BODY


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
    return Ways(pieces.starts, pieces.ends, pieces.start_axes, pieces.end_axes, pieces.reach, pieces.body)


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
        for ray in range(TILE * TILE):
            if lows[ray] >= highs[ray]:
                continue
            u = (i * TILE + ray % TILE + 0.5) * rays.cell
            v = (j * TILE + ray // TILE + 0.5) * rays.cell
            deepest = max(deepest, air_on_set(rays, u, v, start[2] + lows[ray]))
            deepest = max(deepest, air_on_set(rays, u, v, start[2] + highs[ray]))
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
            if len(pieces.body):
                depth = body_depth(rays, ways, i, foot, axis)
            else:
                depth = _capsule_depth(rays, pieces.starts[i], pieces.ends[i], radius)
            found.depths[pieces.moves[i]] = max(found.depths[pieces.moves[i]], depth)
        if len(edges.chips):
            engage(rays, edges, i, radius, pieces.reach[i])
        if len(pieces.body):
            volume, full = cut_body(rays, ways, i, foot, axis)
        else:
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
