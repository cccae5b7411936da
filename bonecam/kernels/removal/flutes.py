"""What the flutes above a ball sweep out of the material of one set of rays, compiled."""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit
from bonecam.kernels.removal.cut import cut_capsule, cylinder_meets
from bonecam.kernels.removal.rays import RaySet

FLUTE_STEP = 0.1
"""The flutes stand this far apart (mm) where they are taken out of the material: between two cuts of a
cylinder of radius R they leave a ridge of FLUTE_STEP^2 / (8 R), 1.3 um for 1 mm."""


NO_BODY = np.zeros((0, 3))
"""The body of a ball-end cutter: its capsules are known without."""


class Ways(NamedTuple):
    """Straight moves of a ball's centre while the axis of its tool turns, in the coordinates of the rays: `starts`,
    `ends`, `start_axes`, `end_axes` (n, 3); `reach` (n,): height of the flutes above the ball's centre, mm, 0 for a
    ball alone. `body` (k, 3): the cones of a bull nose, as `Cutter.body` has them, none of a ball-end cutter."""

    starts: ndarray
    ends: ndarray
    start_axes: ndarray
    end_axes: ndarray
    reach: ndarray
    body: ndarray


@inner_njit()
def piece_pose(ways: Ways, i: int, share: float, foot: ndarray, axis: ndarray) -> None:
    """Write the ball's centre and the unit axis at this share of way `i`."""
    size = 0.0
    for k in range(3):
        foot[k] = (1 - share) * ways.starts[i, k] + share * ways.ends[i, k]
        axis[k] = (1 - share) * ways.start_axes[i, k] + share * ways.end_axes[i, k]
        size += axis[k] * axis[k]
    size = np.sqrt(size)
    for k in range(3):
        axis[k] /= size


@inner_njit()
def travel_of(ways: Ways, i: int, height: float) -> float:
    """How far a point of the tool at this distance from the ball's centre travels at most, mm."""
    shift, turn = 0.0, 0.0
    for k in range(3):
        shift += (ways.ends[i, k] - ways.starts[i, k]) ** 2
        turn += (ways.end_axes[i, k] - ways.start_axes[i, k]) ** 2
    return np.sqrt(shift) + np.sqrt(turn) * height


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
