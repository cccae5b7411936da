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
from numpy import ndarray

from bonecam.kernels import inner_njit
from bonecam.kernels.closest.distance_grids import distance_bound

LOOK_AHEAD = (4.0, 1.5, 0.5, 0.0)
"""How far above the proven height spheres are tried, in radii of the section."""
MIN_RISE = 0.01
"""A sphere that raises the proven height by less (mm) proves nothing."""
REJECTED, OPEN, PROVEN = 0, 1, 2
"""Of a cone: every axis in it meets something (as the grids have it), nothing is known, no axis meets anything."""


class Obstacles(NamedTuple):
    """What a tool stays out of. `sections` (s, 9) of the tool from the spindle down: start and end (mm above the ball's
    centre), radius (mm), 1 for the level or 0 for the material, what the solid may reach out of its grids by (mm),
    the first and behind the last of its `columns` (m, 5): radius, top, bottom, x and y (mm), and the first and behind
    the last of its rows in `cells`, which with `values` are those of all Grids."""

    sections: ndarray
    columns: ndarray
    cells: ndarray
    values: ndarray


class Apexes(NamedTuple):
    """Where tools pivot: `places` (k, 3) of ball centres, how far from there they may be (`growth`, mm), and what is
    known of the balls near their contacts: at each of them a ball that is larger by `room` (mm) touches the contact too
    and is empty; contact normals are within `spread` (radians) of `normals`."""

    places: ndarray
    growth: ndarray
    normals: ndarray
    spread: ndarray
    room: ndarray


@inner_njit()
def _distance(o: Obstacles, s: int, x: float, y: float, z: float) -> float:
    """A lower bound of the distance of a point to what section s stays out of, mm."""
    first, end = int(o.sections[s, 7]), int(o.sections[s, 8])
    d = distance_bound(o.cells, o.values, first, end, x, y, z) - o.sections[s, 4]
    for c in range(int(o.sections[s, 5]), int(o.sections[s, 6])):
        up = max(z - o.columns[c, 1], o.columns[c, 2] - z)
        if up >= d:
            continue
        dx, dy = x - o.columns[c, 3], y - o.columns[c, 4]
        out = np.sqrt(dx * dx + dy * dy) - o.columns[c, 0]
        if out > 0 and up > 0:
            d = min(d, np.sqrt(out * out + up * up))
        else:
            d = min(d, max(out, up))
    return d


@inner_njit()
def prove(
    o: Obstacles, p: Apexes, k: int, a: ndarray, angle: float, first: int, proven: float
) -> tuple[int, int, float]:
    """PROVEN where the tool at apex k is free for all axes within `angle` of the unit vector a, REJECTED or OPEN; and
    how far it is proven: the section, and the height in it. What lies before section `first` and the height `proven`
    in that one is known to be free."""
    sine = np.sin(angle)
    cosine = np.cos(angle)
    chord = 2 * np.sin(angle / 2)
    x, y, z = p.places[k, 0], p.places[k, 1], p.places[k, 2]
    for s in range(first, len(o.sections)):
        up, end, r = o.sections[s, 0], o.sections[s, 1], o.sections[s, 2]
        begins = up
        if o.sections[s, 3] > 0:
            n = p.normals[k]
            dot = min(max(a[0] * n[0] + a[1] * n[1] + a[2] * n[2], -1.0), 1.0)
            lean = np.arccos(dot) + p.spread[k] + angle
            # balls along an axis that leans by this from the normal stay in the larger ball as long
            up = max(up, 2 * p.room[k] * np.cos(min(lean, np.pi / 2)))
            begins = max(begins, 2 * p.room[k])
        if s == first:
            up = max(up, proven)
        last = 0
        while up < end:
            raised = up
            met = False
            for i in range(len(LOOK_AHEAD)):
                ahead = (max(last - 1, 0) + i) % len(LOOK_AHEAD)
                u = up + LOOK_AHEAD[ahead] * r
                d = _distance(o, s, x + u * a[0], y + u * a[1], z + u * a[2]) - p.growth[k]
                side = r + u * sine
                if d > side:
                    half = np.sqrt(d * d - side * side)
                    if u * cosine - half <= up and u * cosine + half > up + MIN_RISE:
                        raised = u * cosine + half
                        last = ahead
                        break
                elif begins <= u <= end and d + chord * u < r:
                    met = True
            if raised == up:
                return (REJECTED if met else OPEN), s, up
            up = raised
    return PROVEN, len(o.sections), 0.0
