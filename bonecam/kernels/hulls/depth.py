"""How far patches are at most from a surface: a bound that holds between the points, compiled.

A patch is bounded along a map of its parameters (`kernels.hulls.mapped_distance`), or by the distance of its
net from one point, and halved until the bound is good enough.
"""

import math

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.bezier.element_search import locate_one
from bonecam.kernels.hulls.footpoints import DepthTarget, footpoint, nearest_footpoint
from bonecam.kernels.hulls.mapped_distance import UNIT_BOX, mapped_distance_bound, middle_parameters, patch_point
from bonecam.kernels.hulls.net import STACK_SIZE, copy, extents, halve

POINT_LIKE = 0.1
"""mm: pieces no larger than this may be bounded by the distance from one point."""

SLENDER = 8.0
"""A piece that is so many times longer than wide is halved along its length."""

MOST_LISTED = 1000
"""Most pieces over the alarm that are returned."""

RELATIVE_ACCURACY = 0.02
"""A bound is good enough up to this share of what the distance is over the alarm."""

CORNERS = np.array([0, 3, 12, 15])
"""Control points of a net at its corners, s first."""


@inner_njit()
def _bound_from_middle(
    net: ndarray, corners: ndarray, bound: float, on: DepthTarget, D: ndarray
) -> tuple[float, float]:
    """A bound (mm) no larger than `bound`, and the distance of the net's middle from the surface. From the
    nearest footpoint of the middle are taken: the largest distance of a control point from it, and the map
    whose corners are footpoints reached from it; a map that bounds better replaces `corners` (4, 2)."""
    middle = np.empty(3)
    other = np.empty((4, 2))
    middle[0], middle[1], middle[2] = patch_point(net, UNIT_BOX, 0.5, 0.5)
    s, t = middle_parameters(corners)
    s, t, distance = nearest_footpoint(middle, s, t, on, D)
    for k in range(4):
        u, v, _ = footpoint(net[CORNERS[k]], s, t, on, D)
        other[k, 0], other[k, 1] = u, v
    new, _, _ = mapped_distance_bound(net, other, on)
    if new < bound:
        bound = new
        copy(other, corners)
    e = locate_one(*on.strips, s - math.floor(s), t)
    far = 0.0
    x = patch_point(on.patches[e], on.boxes[e], s - math.floor(s), t)
    for i in range(16):
        far = max(far, (net[i, 0] - x[0]) ** 2 + (net[i, 1] - x[1]) ** 2 + (net[i, 2] - x[2]) ** 2)
    return min(bound, math.sqrt(far)), distance


@inner_njit()
def _divide(nets: ndarray, corners: ndarray, parts: ndarray, k: int, axis: int, on: DepthTarget, D: ndarray) -> None:
    """Replace piece k by its two halves, k and k + 1: their nets, the parameters of their corners'
    footpoints, and the part of the first net that they are."""
    halve(nets[k], axis, nets[k], nets[k + 1])
    copy(corners[k], corners[k + 1])
    for i in range(4):
        parts[k + 1, i] = parts[k, i]
    middle = 0.5 * (parts[k, 2 * axis] + parts[k, 2 * axis + 1])
    parts[k, 2 * axis + 1] = parts[k + 1, 2 * axis] = middle
    step, across = (1, 2) if axis == 0 else (2, 1)
    for side in range(2):
        first, last = side * across, side * across + step
        s, t = (0.5 * (corners[k, first, 0] + corners[k, last, 0]), 0.5 * (corners[k, first, 1] + corners[k, last, 1]))
        s, t, _ = footpoint(nets[k + 1, CORNERS[first]], s, t, on, D)
        corners[k, last, 0] = corners[k + 1, first, 0] = s
        corners[k, last, 1] = corners[k + 1, first, 1] = t


@njit(cache=True, nogil=True)
def depth_bound(
    nets: ndarray, starts: ndarray, on: DepthTarget, goal: float, alarm: float, accuracy: float, smallest: float
) -> tuple[float, ndarray, ndarray, int]:  # fmt: skip
    """How far (mm) points of the patches with these nets (n, 16, 3) are at most from a surface; the piece
    where that is; pieces (k, 3) with a bound over `alarm` mm; and how many pieces were bounded. A piece is
    told by the number of its net and the parameters of its middle there.

    `starts` (n, 4, 2) are parameters of the surface near the footpoints of the nets' corners. A piece is not
    halved again where its bound is no larger than `goal` mm or than that of another, or at most `accuracy` mm
    (and RELATIVE_ACCURACY) over a distance that some point has, or where it is no larger than `smallest` mm.
    """
    stack = np.empty((STACK_SIZE, 16, 3))
    corners = np.empty((STACK_SIZE, 4, 2))
    parts = np.empty((STACK_SIZE, 4))
    D = np.empty((6, 3))
    place = np.zeros(3)
    over = np.empty((MOST_LISTED, 3))
    most, count, listed = 0.0, 0, 0
    for n in range(len(nets)):
        copy(nets[n], stack[0])
        height = 1
        for k in range(4):
            parts[0, k] = UNIT_BOX[k]
            s, t, _ = footpoint(stack[0, CORNERS[k]], starts[n, k, 0], starts[n, k, 1], on, D)
            corners[0, k, 0], corners[0, k, 1] = s, t
        while height:
            height -= 1
            count += 1
            net = stack[height]
            enough = max(goal, most)
            last = height + 2 > STACK_SIZE
            bound, corner_distance, axis = mapped_distance_bound(net, corners[height], on)
            if bound > enough:
                s, t = extents(net)
                if axis < 0 or max(s, t) > SLENDER * (s if axis == 0 else t):
                    axis = 0 if s >= t else 1
                if corner_distance > enough or max(s, t) < POINT_LIKE or bound <= corner_distance + accuracy or last:
                    bound, distance = _bound_from_middle(net, corners[height], bound, on, D)
                    last = (
                        last
                        or bound <= distance + accuracy + RELATIVE_ACCURACY * max(0.0, distance - alarm)
                        or max(s, t) <= smallest
                    )
            if bound > enough and not last:
                _divide(stack, corners, parts, height, axis, on, D)
                height += 2
                continue
            u, v = 0.5 * (parts[height, 0] + parts[height, 1]), 0.5 * (parts[height, 2] + parts[height, 3])
            if bound > most:
                most = bound
                place[0], place[1], place[2] = n, u, v
            if bound > alarm and listed < MOST_LISTED:
                over[listed, 0], over[listed, 1], over[listed, 2] = n, u, v
                listed += 1
    return most, place, over[:listed], count
