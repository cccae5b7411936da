"""The distance to the nearest of many triangles, up to a limit, compiled: a tree of bounding boxes.

The tree is complete: node n has the children 2n + 1 and 2n + 2, its last row are the leaves, which share the
triangles evenly. Each search begins with the triangle that was nearest to the point before, so points in the
order of a path find their way quickly.
"""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit

DEEPEST = 64
"""Room on the stack of a search: nodes that wait, at most one a level of the tree and one more."""

RUN = 16
"""Triangles that are sorted by insertion."""


@inner_njit()
def _sort(order: ndarray, keys: ndarray, order_after: ndarray, keys_after: ndarray) -> None:
    """Sort triangles by their keys; those of one key stay in their order. Runs of RUN are sorted by insertion, then
    merged two by two (numpy's sort would compile for seconds)."""
    n = len(order)
    run = RUN
    for first in range(0, n, RUN):
        for i in range(first + 1, min(first + RUN, n)):
            one = order[i]
            key = keys[i]
            k = i
            while k > first and key < keys[k - 1]:
                order[k], keys[k] = order[k - 1], keys[k - 1]
                k -= 1
            order[k], keys[k] = one, key
    while run < n:
        for first in range(0, n, 2 * run):
            middle = min(first + run, n)
            end = min(first + 2 * run, n)
            a, b = first, middle
            for k in range(first, end):
                if b >= end or (a < middle and not keys[b] < keys[a]):
                    order_after[k], keys_after[k] = order[a], keys[a]
                    a += 1
                else:
                    order_after[k], keys_after[k] = order[b], keys[b]
                    b += 1
        for k in range(n):
            order[k], keys[k] = order_after[k], keys_after[k]
        run *= 2


@njit(cache=True)
def tree_order(middles: ndarray, leaves: int) -> ndarray:
    """The order of triangles, given by their middles (n, 3), in which the leaves of the tree share them.

    Each part is halved along the longest side of the box round its middles. `leaves` is a power of two.
    """
    n = len(middles)
    order, along = np.arange(n), np.empty(n)
    order_after, along_after = np.empty(n, dtype=np.int64), np.empty(n)
    parts = leaves
    while parts > 1:
        for first in range(0, leaves, parts):
            low, middle, high = (first * n // leaves, (first + parts // 2) * n // leaves, (first + parts) * n // leaves)
            if not low < middle < high:
                continue
            here = order[low:high]
            longest = -1.0
            axis = 0
            for k in range(3):
                smallest = np.inf
                largest = -np.inf
                for i in here:
                    smallest, largest = min(smallest, middles[i, k]), max(largest, middles[i, k])
                if largest - smallest > longest:
                    longest = largest - smallest
                    axis = k
            for i in range(len(here)):
                along[i] = middles[here[i], axis]
            _sort(here, along[: len(here)], order_after, along_after)
        parts //= 2
    return order


@njit(cache=True)
def boxes_of(triangles: ndarray, leaves: int) -> ndarray:
    """Boxes (2 leaves - 1, 6) of the tree over ordered triangles (n, 9): lowest x, y, z, highest x, y, z;
    the box of a node without triangles is from infinity to minus infinity."""
    n = len(triangles)
    boxes = np.empty((2 * leaves - 1, 6))
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    for leaf in range(leaves):
        box = boxes[leaves - 1 + leaf]
        for i in range(leaf * n // leaves, (leaf + 1) * n // leaves):
            for k in range(9):
                box[k % 3] = min(box[k % 3], triangles[i, k])
                box[3 + k % 3] = max(box[3 + k % 3], triangles[i, k])
    for node in range(leaves - 2, -1, -1):
        for k in range(3):
            boxes[node, k] = min(boxes[2 * node + 1, k], boxes[2 * node + 2, k])
            boxes[node, 3 + k] = max(boxes[2 * node + 1, 3 + k], boxes[2 * node + 2, 3 + k])
    return boxes


@njit(inline="always")
def _squared(x: float, y: float, z: float) -> float:
    return x * x + y * y + z * z


@njit(inline="always")
def _squared_box_distance(px: float, py: float, pz: float, boxes: ndarray, n: int) -> float:
    """Squared distance from a box; infinite where it is empty."""
    x = max(max(boxes[n, 0] - px, px - boxes[n, 3]), 0.0)
    y = max(max(boxes[n, 1] - py, py - boxes[n, 4]), 0.0)
    z = max(max(boxes[n, 2] - pz, pz - boxes[n, 5]), 0.0)
    return _squared(x, y, z)


@inner_njit()
def squared_triangle_distance(px: float, py: float, pz: float, t: ndarray) -> float:
    """Squared distance from a triangle (Ericson 2005, section 5.1.5)."""
    abx, aby, abz = t[3] - t[0], t[4] - t[1], t[5] - t[2]
    acx, acy, acz = t[6] - t[0], t[7] - t[1], t[8] - t[2]
    apx, apy, apz = px - t[0], py - t[1], pz - t[2]
    d1, d2 = abx * apx + aby * apy + abz * apz, acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return _squared(apx, apy, apz)
    bpx, bpy, bpz = px - t[3], py - t[4], pz - t[5]
    d3, d4 = abx * bpx + aby * bpy + abz * bpz, acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return _squared(bpx, bpy, bpz)
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0 and d1 > d3:
        v = d1 / (d1 - d3)
        return _squared(apx - v * abx, apy - v * aby, apz - v * abz)
    cpx, cpy, cpz = px - t[6], py - t[7], pz - t[8]
    d5, d6 = abx * cpx + aby * cpy + abz * cpz, acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return _squared(cpx, cpy, cpz)
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0 and d2 > d6:
        w = d2 / (d2 - d6)
        return _squared(apx - w * acx, apy - w * acy, apz - w * acz)
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6 and (d4 - d3) + (d5 - d6) > 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return _squared(bpx - w * (t[6] - t[3]), bpy - w * (t[7] - t[4]), bpz - w * (t[8] - t[5]))
    whole = va + vb + vc
    if whole <= 0.0:  # a triangle without area
        return min(_squared(apx, apy, apz), min(_squared(bpx, bpy, bpz), _squared(cpx, cpy, cpz)))
    v, w = vb / whole, vc / whole
    return _squared(apx - v * abx - w * acx, apy - v * aby - w * acy, apz - v * abz - w * acz)


@njit(cache=True, nogil=True)
def distances_within(points: ndarray, limits: ndarray, slack: float, triangles: ndarray, boxes: ndarray) -> ndarray:
    """Distance of each point from the nearest triangle, or its limit where none is nearer. With a `slack` a lower bound
    of it, less by no more than this share: boxes that could not bring it down by more are left out."""
    near = (1 + slack) ** 2
    n = len(triangles)
    leaves = (len(boxes) + 1) // 2
    distances = np.empty(len(points))
    stack = np.empty(DEEPEST, dtype=np.int64)
    reach = np.empty(DEEPEST)
    last = 0
    for i in range(len(points)):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        best = limits[i] * limits[i]
        best = min(best, squared_triangle_distance(px, py, pz, triangles[last]))
        left_out = np.inf
        stack[0] = 0
        reach[0] = _squared_box_distance(px, py, pz, boxes, 0)
        height = 1
        while height:
            height -= 1
            if reach[height] * near >= best:
                left_out = min(left_out, reach[height])
                continue
            node = stack[height]
            if node >= leaves - 1:
                leaf = node - leaves + 1
                for k in range(leaf * n // leaves, (leaf + 1) * n // leaves):
                    d = squared_triangle_distance(px, py, pz, triangles[k])
                    if d < best:
                        best, last = d, k
                continue
            a, b = 2 * node + 1, 2 * node + 2
            to_a = _squared_box_distance(px, py, pz, boxes, a)
            to_b = _squared_box_distance(px, py, pz, boxes, b)
            if to_a < to_b:
                a, b, to_a, to_b = b, a, to_b, to_a
            # the nearer child comes off the stack first
            for child, to in ((a, to_a), (b, to_b)):
                if to * near < best:
                    stack[height], reach[height] = child, to
                    height += 1
                else:
                    left_out = min(left_out, to)
        distances[i] = np.sqrt(min(best, left_out))
    return distances
