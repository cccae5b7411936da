"""Footpoints on the surface that depths are measured to, compiled: from parameters near them, and the nearest
of all that are found from seeds all over the surface.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit
from bonecam.kernels.closest.newton import descend
from bonecam.kernels.hulls.net import box_distance


class DepthTarget(NamedTuple):
    """The surface that depths are measured to, as `kernels.closest.newton.descend` takes it: patches (e, 16,
    4) whose weights are all one, over `boxes` in `strips`, s closed with the period 1. `seeds` (e, k, 5) are
    s, t, x, y, z of points on each element; `hulls` (e, 6) are boxes round its elements, lowest x, y, z
    first."""

    patches: ndarray
    boxes: ndarray
    strips: tuple[ndarray, ...]
    domain: ndarray
    period: ndarray
    poles: ndarray
    limit: ndarray
    seeds: ndarray
    hulls: ndarray


@inner_njit()
def footpoint(point: ndarray, s: float, t: float, on: DepthTarget, D: ndarray) -> tuple[float, float, float]:
    """Parameters of the footpoint of a point reached from (s, t), and its distance (mm). The footpoint's s is
    moved on by whole turns to within half a turn of the start. A start at a pole is returned as it is, at an
    infinite distance: its s is a direction. `D` (6, 3) is overwritten."""
    if (on.poles[0] and t <= on.domain[1, 0]) or (on.poles[1] and t >= on.domain[1, 1]):
        return s, t, np.inf
    a, b, half = descend(on.patches, on.boxes, on.strips, on.domain, on.period, on.poles, on.limit, point, s, t, D)
    return a + math.floor(s - a + 0.5), b, math.sqrt(2.0 * half)


@inner_njit()
def nearest_footpoint(point: ndarray, s: float, t: float, on: DepthTarget, D: ndarray) -> tuple[float, float, float]:
    """Parameters and distance (mm) of the nearest footpoint found from (s, t) and from the nearest seed of
    every element whose box is nearer than the best footpoint so far. `D` (6, 3) is overwritten."""
    s, t, distance = footpoint(point, s, t, on, D)
    for e in range(len(on.seeds)):
        if box_distance(on.hulls[e], point) >= distance:
            continue
        best = np.inf
        k = 0
        for i in range(on.seeds.shape[1]):
            x, y, z = on.seeds[e, i, 2] - point[0], on.seeds[e, i, 3] - point[1], on.seeds[e, i, 4] - point[2]
            if x * x + y * y + z * z < best:
                best = x * x + y * y + z * z
                k = i
        u, v, other = footpoint(point, on.seeds[e, k, 0], on.seeds[e, k, 1], on, D)
        if other < distance:
            s, t, distance = u, v, other
    return s, t, distance
