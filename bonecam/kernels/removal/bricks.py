"""The cylinders and cones of a tool against coarse bricks of the material, compiled: lower bounds of their clearance.

A tool is a stack of them along its axis; heights are told from the ball's centre.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import njit
from bonecam.kernels.removal.rays import TILE, RaySet

SAMPLES = 4
"""Points on a brick's length of material: what lies between two of them is `spare` of a brick."""
WATCHED = 8.0
"""Larger bounds are not looked into, mm."""


class Bricks(NamedTuple):
    """Cubes of side `size` from `corner` (3,) on, in the part's frame. `distance` (l, m, n): from the middle
    of a cube to the middle of the nearest one that holds material; material lies at most `spare` outside
    those; mm."""

    distance: ndarray
    corner: ndarray
    size: float
    spare: float


@njit(cache=True, nogil=True)
def mark_bricks(
    rays: RaySet, rotation: ndarray, origin: ndarray, step: int, corner: ndarray, size: float, occupied: ndarray
) -> None:
    """Set `occupied` (l, m, n) in each brick that material on every `step`-th ray either way lies in.

    The point (u, v, w) of the rays is origin + u rotation[0] + v rotation[1] + w rotation[2] in the part's
    frame.
    """
    rows, columns = rays.tile_of.shape
    place = np.empty(3)
    for i in range(step // 2, rows * TILE, step):
        for j in range(step // 2, columns * TILE, step):
            tile = rays.tile_of[i // TILE, j // TILE]
            if tile < 0:
                continue
            ray = (j % TILE) * TILE + i % TILE
            u, v = (i + 0.5) * rays.cell, (j + 0.5) * rays.cell
            for k in range(3):
                place[k] = (origin[k] + u * rotation[0, k] + v * rotation[1, k] - corner[k]) / size
            for m in range(rays.counts[tile, ray]):
                low, high = rays.spans[tile, ray, 2 * m], rays.spans[tile, ray, 2 * m + 1]
                points = int(np.ceil((high - low) * SAMPLES / size)) + 1
                for n in range(points):
                    w = (low + (high - low) * n / max(points - 1, 1)) / size
                    a = int(place[0] + w * rotation[2, 0])
                    b = int(place[1] + w * rotation[2, 1])
                    c = int(place[2] + w * rotation[2, 2])
                    occupied[a, b, c] = True


@njit(cache=True, nogil=True)
def material_distance(bricks: Bricks, x: float, y: float, z: float) -> float:
    """A lower bound of the distance of a point (part's frame) from the material, mm.

    Of a point outside the box of the bricks, at distance o from the box's nearest point q, no material is
    nearer than sqrt(o^2 + d(q)^2), because the box is convex.
    """
    place = (x - bricks.corner[0], y - bricks.corner[1], z - bricks.corner[2])
    outside, off = 0.0, 0.0
    i, j, k = 0, 0, 0
    for axis in range(3):
        count = bricks.distance.shape[axis]
        inside = min(max(place[axis], 0.0), count * bricks.size)
        outside += (place[axis] - inside) ** 2
        index = min(int(inside / bricks.size), count - 1)
        off += (inside - (index + 0.5) * bricks.size) ** 2
        if axis == 0:
            i = index
        elif axis == 1:
            j = index
        else:
            k = index
    half_diagonal = bricks.size * np.sqrt(0.75)
    to_material = max(bricks.distance[i, j, k] - half_diagonal - bricks.spare - np.sqrt(off), 0.0)
    return np.sqrt(outside + to_material * to_material)


@njit(cache=True, nogil=True)
def bound_clearances(
    starts: ndarray,
    ends: ndarray,
    start_axes: ndarray,
    end_axes: ndarray,
    sections: ndarray,
    watched: ndarray,
    bricks: Bricks,
    bounds: ndarray,
    near: ndarray,
) -> None:
    """Write lower bounds of the distance (mm) between material and each section over each piece of a move
    into `bounds` (n, s), and the heights between which material may be nearer than `watched` (s,) into `near`
    (n, s, 2).

    Pieces as in `sweep.Pieces`, in the part's frame. `sections` (s, 4): from, to, radius at either; cones are
    taken as the cylinders that hold them. A cylinder lies in the balls about points of its axis that reach half-way
    to the next; over the piece it moves by half of what it travels at most from its middle.
    """
    for i in range(len(bounds)):
        shift, turn = 0.0, 0.0
        for k in range(3):
            shift += (ends[i, k] - starts[i, k]) ** 2
            turn += (end_axes[i, k] - start_axes[i, k]) ** 2
        shift, turn = np.sqrt(shift) / 2, np.sqrt(turn) / 2
        x = (starts[i, 0] + ends[i, 0]) / 2
        y = (starts[i, 1] + ends[i, 1]) / 2
        z = (starts[i, 2] + ends[i, 2]) / 2
        a = start_axes[i, 0] + end_axes[i, 0]
        b = start_axes[i, 1] + end_axes[i, 1]
        c = start_axes[i, 2] + end_axes[i, 2]
        size = np.sqrt(a * a + b * b + c * c)
        a, b, c = a / size, b / size, c / size
        for s in range(len(sections)):
            start, end = sections[s, 0], sections[s, 1]
            radius = max(sections[s, 2], sections[s, 3])
            steps = max(1, int(np.ceil(2.0 * (end - start) / radius)))
            step = (end - start) / steps
            ball = np.sqrt(radius * radius + step * step / 4)
            least = np.inf
            for both in range(2):
                # first the bound, then the heights at which it may be met
                for m in range(steps):
                    u = start + (m + 0.5) * step
                    free = material_distance(bricks, x + u * a, y + u * b, z + u * c)
                    free -= ball + shift + turn * np.hypot(u + step / 2, radius)
                    if both == 0:
                        least = min(least, free)
                    elif free <= watched[s]:
                        near[i, s, 1] = start + (m + 1) * step
                        if near[i, s, 0] < 0.0:
                            near[i, s, 0] = start + m * step
                if both == 0:
                    bounds[i, s] = least
                    near[i, s, 0] = -1.0
                    if least > watched[s]:
                        break
