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


class Groups(NamedTuple):
    """Groups of directions: unit `axes` (g, 3) and `angles` (g,) of the cones that hold them, radians, and their
    `members` (d,), those of group i from `starts[i]` up to `starts[i + 1]`."""

    axes: ndarray
    angles: ndarray
    starts: ndarray
    members: ndarray


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
def free_directions(o: Obstacles, p: Apexes, directions: ndarray, groups: Groups, asked: ndarray) -> ndarray:
    """Which of the unit `directions` (d, 3) are free at each apex, (k, d); False where not `asked` (k, d). A group is
    tested by one cone first, and one by one where that is not free."""
    found = np.zeros(asked.shape, dtype=np.bool_)
    for k in range(len(asked)):
        for g in range(len(groups.axes)):
            members = groups.members[groups.starts[g] : groups.starts[g + 1]]
            wanted = 0
            for d in members:
                wanted += asked[k, d]
            if not wanted:
                continue
            together = wanted > 1 and _free(o, p, k, groups.axes[g], groups.angles[g])
            for d in members:
                if asked[k, d]:
                    found[k, d] = together or _free(o, p, k, directions[d], 0.0)
    return found


@njit(cache=True, nogil=True)
def _largest(o: Obstacles, p: Apexes, k: int, a: ndarray, low: float, high: float) -> float:
    """The largest angle up to `high` that `_free` proves, which it does for `low`."""
    if _free(o, p, k, a, high):
        return high
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        if _free(o, p, k, a, middle):
            low = middle
        else:
            high = middle
    return low


@njit(cache=True, nogil=True)
def _promising(
    wanted: ndarray, directions: ndarray, scores: ndarray, which: ndarray, promises: ndarray
) -> None:
    """Put into `which` the directions of largest `promises`, in their order: of those with positive scores, the score
    less the angle to the unit vector `wanted`."""
    promises[:] = -np.inf
    for d in range(len(directions)):
        if scores[d] > max(promises[-1], 0.0):
            dot = directions[d, 0] * wanted[0] + directions[d, 1] * wanted[1] + directions[d, 2] * wanted[2]
            promise = scores[d] - np.arccos(min(max(dot, -1.0), 1.0))
            if promise > promises[-1]:
                i = len(which) - 1
                while i > 0 and promise > promises[i - 1]:
                    which[i], promises[i] = which[i - 1], promises[i - 1]
                    i -= 1
                which[i], promises[i] = d, promise


@njit(cache=True, nogil=True)
def deepest_cones(
    o: Obstacles,
    p: Apexes,
    wanted: ndarray,
    directions: ndarray,
    room: ndarray,
    tried: int,
    largest: float,
    width_share: float,
) -> tuple[ndarray, ndarray]:
    """For each apex the axis and the angle (radians, `largest` at most; -1 where there is none) of the cone of free
    axes for which the depth of the unit vector `wanted` (k, 3) in it and `width_share` of its angle sum to most.

    The cones are those about `wanted` and about `tried` of the unit `directions` (d, 3): those that promise most by
    their `room` (k, d), the angle (radians) to what collides, 0 where they do themselves.
    """
    axes, angles = wanted.copy(), np.full(len(wanted), -1.0)
    which, promises = np.empty(tried, dtype=np.int64), np.empty(tried)
    share = 1 + width_share
    for k in range(len(wanted)):
        best = -np.inf
        if _free(o, p, k, wanted[k], 0.0):
            angles[k] = _largest(o, p, k, wanted[k], 0.0, largest)
            best = share * angles[k]
        _promising(wanted[k], directions, share * room[k], which, promises)
        for i in range(tried):
            if promises[i] <= best:
                break
            d = which[i]
            off = share * room[k, d] - promises[i]
            least = max((best + off) / share, 0.0)
            if least < largest and _free(o, p, k, directions[d], least):
                angles[k] = _largest(o, p, k, directions[d], least, largest)
                axes[k] = directions[d]
                best = share * angles[k] - off
    return axes, angles


@njit(cache=True, nogil=True)
def proof_slacks(o: Obstacles, p: Apexes, axes: ndarray, angles: ndarray, most: float) -> ndarray:
    """By how much more (mm, `most` at most) each apex may be off its place for the cone about `axes` (k, 3) of `angles`
    (k, radians) to be proven still; 0 where it is not proven."""
    found = np.zeros(len(angles))
    off = p.growth.copy()
    moved = Apexes(p.places, off, p.normals, p.spread, p.room)
    for k in range(len(angles)):
        if not angles[k] > 0:
            continue
        low, high = 0.0, 2 * most  # the first trial is `most`
        for _ in range(BISECTIONS):
            middle = min((low + high) / 2, most)
            off[k] = p.growth[k] + middle
            if _free(o, moved, k, axes[k], angles[k]):
                low = middle
            else:
                high = middle
            if low == most:
                break
        found[k] = low
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
