"""The moves of a program through one set of rays, in their order, compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.removal.cut import cut_capsule, cylinder_meets
from bonecam.kernels.removal.depth import capsule_depth
from bonecam.kernels.removal.frustum import frustum_clearance
from bonecam.kernels.removal.rays import RaySet

FLUTE_STEP = 0.1
"""The flutes stand this far apart (mm) where they are taken out of the material: between two cuts of a
cylinder of radius R they leave a ridge of FLUTE_STEP^2 / (8 R), 1.3 um for 1 mm."""
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


class Found(NamedTuple):
    """What a sweep finds. `volumes` (moves,): removed by each move, mm^3; `depths` (moves,): how deep probed moves
    cut, mm. `least` (3,): least distance of shank, holder and spindle from material so far, mm; `where` (3,): its
    move. `touched` (3,): first move in which the distance is below the one allowed, -1 for none; nothing is measured
    after it."""

    volumes: ndarray
    depths: ndarray
    least: ndarray
    where: ndarray
    touched: ndarray


@njit(cache=True, nogil=True)
def piece_pose(pieces: Pieces, i: int, share: float, foot: ndarray, axis: ndarray) -> None:
    """Write the ball's centre and the unit axis at this share of a piece."""
    size = 0.0
    for k in range(3):
        foot[k] = (1 - share) * pieces.starts[i, k] + share * pieces.ends[i, k]
        axis[k] = (1 - share) * pieces.start_axes[i, k] + share * pieces.end_axes[i, k]
        size += axis[k] * axis[k]
    size = np.sqrt(size)
    for k in range(3):
        axis[k] /= size


@njit(cache=True, nogil=True)
def travel_of(pieces: Pieces, i: int, height: float) -> float:
    """How far a point of the tool at this distance from the ball's centre travels at most, mm."""
    shift, turn = 0.0, 0.0
    for k in range(3):
        shift += (pieces.ends[i, k] - pieces.starts[i, k]) ** 2
        turn += (pieces.end_axes[i, k] - pieces.start_axes[i, k]) ** 2
    return np.sqrt(shift) + np.sqrt(turn) * height


@njit(cache=True, nogil=True)
def _flutes_meet(rays: RaySet, pieces: Pieces, i: int, radius: float, foot: ndarray, axis: ndarray) -> bool:
    """Whether the flutes may meet material: those in the middle of the piece, larger by half of their
    travel."""
    reach = pieces.reach[i]
    half = travel_of(pieces, i, reach) / 2
    piece_pose(pieces, i, 0.5, foot, axis)
    for k in range(3):
        foot[k] -= half * axis[k]
    return bool(cylinder_meets(rays, foot, axis, reach + 2 * half, radius + half))


@njit(cache=True, nogil=True)
def _clearance(
    rays: RaySet,
    pieces: Pieces,
    i: int,
    s: int,
    section: ndarray,
    least: float,
    foot: ndarray,
    axis: ndarray,
) -> float:
    """The distance that section number `s` keeps from material over a piece, or `least` where it is more: that at
    poses along it, which come closer while half of the way from one to the next may bring it below `least`."""
    low, high = pieces.near[i, s, 0], pieces.near[i, s, 1]
    taper = (section[3] - section[2]) / (section[1] - section[0])
    radius = section[2] + taper * (low - section[0])
    travel = travel_of(pieces, i, np.hypot(high, max(section[2], section[3])))
    step = max(travel, TOOL_STEP)
    while True:
        steps = max(int(np.ceil(travel / step)), 1)
        slack = travel / steps / 2
        near = least + slack
        for k in range(steps):
            piece_pose(pieces, i, (k + 0.5) / steps, foot, axis)
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
    found: Found,
    turn: int,
) -> int:
    """Take what ball and flutes sweep out of the material, piece by piece from `first` on, and measure the sections
    above them against what stands then; returns the piece at which a ray has no room for one more interval, or
    the number of pieces.

    `sections` (s, 4): from, to, radius at either; `parts` (s,): 0 for the shank, 1 for the holder, 2 for the
    spindle; `allowed` is the signed distance (mm) that they may have. Each of the SETS of rays measures every
    third piece, from piece `turn` on.
    """
    foot, axis, top = np.empty(3), np.empty(3), np.empty(3)
    for i in range(first, len(pieces.starts)):
        if pieces.probed[i]:
            depth = capsule_depth(rays, pieces.starts[i], pieces.ends[i], radius)
            found.depths[pieces.moves[i]] = max(found.depths[pieces.moves[i]], depth)
        volume, full = cut_capsule(rays, pieces.starts[i], pieces.ends[i], radius)
        found.volumes[pieces.moves[i]] += volume
        if full:
            return i
        if pieces.reach[i] > 0.0 and _flutes_meet(rays, pieces, i, radius, foot, axis):
            steps = max(int(np.ceil(travel_of(pieces, i, pieces.reach[i]) / FLUTE_STEP)), 1)
            for k in range(1, steps + 1):
                piece_pose(pieces, i, k / steps, foot, axis)
                if not cylinder_meets(rays, foot, axis, pieces.reach[i], radius):
                    continue
                for n in range(3):
                    top[n] = foot[n] + pieces.reach[i] * axis[n]
                volume, full = cut_capsule(rays, foot, top, radius, True)
                found.volumes[pieces.moves[i]] += volume
                if full:
                    return i
        for s in range(len(sections) if i % SETS == turn else 0):
            part = parts[s]
            if found.touched[part] >= 0 or pieces.bounds[i, s] >= found.least[part]:
                continue
            near = _clearance(rays, pieces, i, s, sections[s], found.least[part], foot, axis)
            if near < allowed:
                found.touched[part] = pieces.moves[i]
            if near < found.least[part]:
                found.least[part] = near
                found.where[part] = pieces.moves[i]
    return len(pieces.starts)
