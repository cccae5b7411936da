"""Tools proven free for all axes of a cone at once, compiled: spheres about points of the cone's axis, one behind
the other.

A sphere of radius D about the point of the axis at height u is empty. For every axis within the angle rho of the cone's
it holds the tool's disc of radius r at each height between

    u cos(rho) -+ sqrt(D^2 - (r + u sin(rho))^2);

with rho = 0 these are the spheres of one tool. Where the apex may lie anywhere within `growth` of its place, D is
less by that.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.closest.distance_grids import Grids, distance_bound

LOOK_AHEAD = (4.0, 1.5, 0.5, 0.0)
"""How far above the proven height spheres are tried, in radii of the section."""
MIN_RISE = 0.01
"""A sphere that raises the proven height by less (mm) proves nothing."""
BISECTIONS = 6
"""Halvings of the interval of angles in which the largest one is sought."""


class Obstacles(NamedTuple):
    """What a tool stays out of. `sections` (s, 7) of the tool from the spindle down: start and end (mm above the ball's
    centre), radius (mm), 1 for the level or 0 for the material, what the solid may reach out of its grids by (mm),
    and the first and behind the last of its `columns` (m, 3): radius, top and bottom (mm)."""

    sections: ndarray
    columns: ndarray
    level: Grids
    material: Grids


class Apexes(NamedTuple):
    """Where tools pivot: `places` (k, 3) of ball centres, how far from there they may be (`growth`, mm), and what is
    known of the balls near their contacts: at each of them a ball that is larger by `room` (mm) touches the contact too
    and is empty; contact normals are within `spread` (radians) of `normals`."""

    places: ndarray
    growth: ndarray
    normals: ndarray
    spread: ndarray
    room: ndarray


@njit(cache=True, nogil=True)
def _distance(o: Obstacles, s: int, x: float, y: float, z: float) -> float:
    """A lower bound of the distance of a point to what section s stays out of, mm."""
    if o.sections[s, 3] > 0:
        d = distance_bound(o.level, x, y, z)
    else:
        d = distance_bound(o.material, x, y, z)
    d -= o.sections[s, 4]
    across = np.sqrt(x * x + y * y)
    for c in range(int(o.sections[s, 5]), int(o.sections[s, 6])):
        out = across - o.columns[c, 0]
        up = max(z - o.columns[c, 1], o.columns[c, 2] - z)
        if out > 0 and up > 0:
            d = min(d, np.sqrt(out * out + up * up))
        else:
            d = min(d, max(out, up))
    return d


@njit(cache=True, nogil=True)
def _free(o: Obstacles, p: Apexes, k: int, a: ndarray, angle: float) -> bool:
    """Whether the tool at apex k is proven free for all axes within `angle` of the unit vector a."""
    sine, cosine = np.sin(angle), np.cos(angle)
    x, y, z = p.places[k, 0], p.places[k, 1], p.places[k, 2]
    for s in range(len(o.sections)):
        up, end, r = o.sections[s, 0], o.sections[s, 1], o.sections[s, 2]
        if o.sections[s, 3] > 0:
            n = p.normals[k]
            dot = min(max(a[0] * n[0] + a[1] * n[1] + a[2] * n[2], -1.0), 1.0)
            lean = np.arccos(dot) + p.spread[k] + angle
            # balls along an axis that leans by this from the normal stay in the larger ball as long
            up = max(up, 2 * p.room[k] * np.cos(min(lean, np.pi / 2)))
        while up < end:
            raised = up
            for ahead in LOOK_AHEAD:
                u = up + ahead * r
                d = _distance(o, s, x + u * a[0], y + u * a[1], z + u * a[2]) - p.growth[k]
                side = r + u * sine
                if d > side:
                    half = np.sqrt(d * d - side * side)
                    if u * cosine - half <= up and u * cosine + half > up + MIN_RISE:
                        raised = u * cosine + half
                        break
            if raised == up:
                return False
            up = raised
    return True


@njit(cache=True, nogil=True)
def free_directions(o: Obstacles, p: Apexes, directions: ndarray, asked: ndarray) -> ndarray:
    """Which of the unit `directions` (d, 3) are free at each apex, (k, d); False where not `asked` (k, d)."""
    found = np.zeros(asked.shape, dtype=np.bool_)
    for k in range(len(asked)):
        for d in range(len(directions)):
            if asked[k, d]:
                found[k, d] = _free(o, p, k, directions[d], 0.0)
    return found


@njit(cache=True, nogil=True)
def cone_angles(o: Obstacles, p: Apexes, which: ndarray, axes: ndarray, largest: float) -> ndarray:
    """The largest angle (radians, `largest` at most; -1 where not even the axis is free) of cones with apexes
    `which` (n,) about unit `axes` (n, 3) all of whose axes are free."""
    found = np.full(len(which), -1.0)
    for i in range(len(which)):
        k = which[i]
        if not _free(o, p, k, axes[i], 0.0):
            continue
        low, high = 0.0, largest
        if _free(o, p, k, axes[i], high):
            low = high
        else:
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                if _free(o, p, k, axes[i], middle):
                    low = middle
                else:
                    high = middle
        found[i] = low
    return found


@njit(cache=True, nogil=True)
def angles_to_blocked(free: ndarray, order: ndarray, angles: ndarray) -> ndarray:
    """The angle (k, d) from each direction to the nearest one that is not `free` (k, d), 0 of such a one;
    `order` (d, m) are the nearest m directions of each, `angles` (d, m) how far they are: the last one where
    all are free."""
    found = np.zeros(free.shape)
    for k in range(len(free)):
        for d in range(free.shape[1]):
            if free[k, d]:
                found[k, d] = angles[d, -1]
                for m in range(order.shape[1]):
                    if not free[k, order[d, m]]:
                        found[k, d] = angles[d, m]
                        break
    return found
