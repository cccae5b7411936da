"""What the flutes above a ball sweep out of the material of one set of rays, compiled.

A way is one straight move of the ball's centre while the axis turns: any named tuple with `starts`, `ends` (n, 3),
`start_axes`, `end_axes` (n, 3) and `reach` (n,), the height above the ball's centre up to which flutes may meet
material, in the coordinates of the rays.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.removal.cut import cut_capsule, cylinder_meets
from bonecam.kernels.removal.rays import RaySet

FLUTE_STEP = 0.1
"""The flutes stand this far apart (mm) where they are taken out of the material: between two cuts of a
cylinder of radius R they leave a ridge of FLUTE_STEP^2 / (8 R), 1.3 um for 1 mm."""


@njit(cache=True, nogil=True)
def piece_pose(pieces: Any, i: int, share: float, foot: ndarray, axis: ndarray) -> None:
    """Write the ball's centre and the unit axis at this share of way `i`."""
    size = 0.0
    for k in range(3):
        foot[k] = (1 - share) * pieces.starts[i, k] + share * pieces.ends[i, k]
        axis[k] = (1 - share) * pieces.start_axes[i, k] + share * pieces.end_axes[i, k]
        size += axis[k] * axis[k]
    size = np.sqrt(size)
    for k in range(3):
        axis[k] /= size


@njit(cache=True, nogil=True)
def travel_of(pieces: Any, i: int, height: float) -> float:
    """How far a point of the tool at this distance from the ball's centre travels at most, mm."""
    shift, turn = 0.0, 0.0
    for k in range(3):
        shift += (pieces.ends[i, k] - pieces.starts[i, k]) ** 2
        turn += (pieces.end_axes[i, k] - pieces.start_axes[i, k]) ** 2
    return np.sqrt(shift) + np.sqrt(turn) * height


@njit(cache=True, nogil=True)
def flutes_meet(rays: RaySet, pieces: Any, i: int, radius: float, foot: ndarray, axis: ndarray) -> bool:
    """Whether the flutes may meet material: those in the middle of way `i`, larger by half of their travel, which
    `foot` and `axis` then hold."""
    reach = pieces.reach[i]
    half = travel_of(pieces, i, reach) / 2
    piece_pose(pieces, i, 0.5, foot, axis)
    for k in range(3):
        foot[k] -= half * axis[k]
    return bool(cylinder_meets(rays, foot, axis, reach + 2 * half, radius + half))


@njit(cache=True, nogil=True)
def cut_flutes(
    rays: RaySet, pieces: Any, i: int, radius: float, foot: ndarray, axis: ndarray, top: ndarray
) -> tuple[float, bool]:
    """Take what the flutes sweep on way `i` out of the material, their place at its start left out; the volume removed
    (mm^3), and whether a ray has no room for one more interval. `foot`, `axis` and `top` (3,) are written on."""
    removed = 0.0
    if pieces.reach[i] <= 0.0 or not flutes_meet(rays, pieces, i, radius, foot, axis):
        return removed, False
    steps = max(int(np.ceil(travel_of(pieces, i, pieces.reach[i]) / FLUTE_STEP)), 1)
    for k in range(1, steps + 1):
        piece_pose(pieces, i, k / steps, foot, axis)
        if not cylinder_meets(rays, foot, axis, pieces.reach[i], radius):
            continue
        for n in range(3):
            top[n] = foot[n] + pieces.reach[i] * axis[n]
        volume, full = cut_capsule(rays, foot, top, radius, True)
        removed += volume
        if full:
            return removed, True
    return removed, False
