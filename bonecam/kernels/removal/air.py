"""How far places in material are from air, compiled, on three sets of rays that cross one another."""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.removal.rays import TILE, RaySet

FINE = 5
"""A search disc is first looked at on rays this many to its radius, then on all rays about the best one."""


@njit(cache=True, nogil=True)
def _interval(rays: RaySet, i: int, j: int, w: float) -> tuple[float, float]:
    """The interval of material that holds w on ray (i, j); the first end is larger where w is in air."""
    rows, columns = rays.tile_of.shape
    if i < 0 or j < 0 or i >= rows * TILE or j >= columns * TILE:
        return 1.0, 0.0
    tile = rays.tile_of[i // TILE, j // TILE]
    if tile < 0:
        return 1.0, 0.0
    ray = (j % TILE) * TILE + i % TILE
    for k in range(rays.counts[tile, ray]):
        low, high = rays.spans[tile, ray, 2 * k], rays.spans[tile, ray, 2 * k + 1]
        if low <= w <= high:
            return low, high
    return 1.0, 0.0


@njit(cache=True, nogil=True)
def _on_ray(rays: RaySet, i: int, j: int, u: float, v: float, w: float) -> float:
    """Squared distance from (u, v, w) to the nearest air on ray (i, j)."""
    x, y = (i + 0.5) * rays.cell - u, (j + 0.5) * rays.cell - v
    low, high = _interval(rays, i, j, w)
    along = min(w - low, high - w) if low <= high else 0.0
    return x * x + y * y + along * along


@njit(cache=True, nogil=True)
def _nearest(rays: RaySet, u: float, v: float, w: float, best: float) -> float:
    """The smaller of `best` and the squared distance from (u, v, w) to air, found on one set."""
    cell = rays.cell
    i, j = int(np.floor(u / cell)), int(np.floor(v / cell))
    # the rays beside the place are a share of a cell off it: what they tell belongs to themselves
    low, high = _interval(rays, i, j, w)
    if low > high:
        return 0.0
    best = min(best, min(w - low, high - w) ** 2)
    step = max(int(np.sqrt(best) / (FINE * cell)), 1)
    at_i, at_j = i, j
    count = int(np.sqrt(best) / (step * cell)) + 1
    for a in range(-count, count + 1):
        for b in range(-count, count + 1):
            if (a * a + b * b) * (step * cell) ** 2 > 2 * best:
                continue
            found = _on_ray(rays, i + a * step, j + b * step, u, v, w)
            if found < best:
                best, at_i, at_j = found, i + a * step, j + b * step
    if step > 1:
        for a in range(1 - step, step):
            for b in range(1 - step, step):
                best = min(best, _on_ray(rays, at_i + a, at_j + b, u, v, w))
    return best


@njit(cache=True, nogil=True)
def air_on_set(rays: RaySet, u: float, v: float, w: float) -> float:
    """Distance from (u, v, w) to the nearest air on one set, mm; 0 in air."""
    return np.sqrt(_nearest(rays, u, v, w, np.inf))


@njit(cache=True, nogil=True)
def air_distances(x_rays: RaySet, y_rays: RaySet, z_rays: RaySet, points: ndarray, found: ndarray) -> None:
    """Write the distance of each point (n, 3) (grid's coordinates) from the nearest air into `found` (n,),
    mm."""
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        best = _nearest(x_rays, y, z, x, np.inf)
        best = _nearest(y_rays, z, x, y, best)
        best = _nearest(z_rays, x, y, z, best)
        found[n] = np.sqrt(best)


@njit(cache=True, nogil=True)
def in_material(x_rays: RaySet, y_rays: RaySet, z_rays: RaySet, points: ndarray, found: ndarray) -> None:
    """Write whether each point lies in material, as two sets of the three tell, into `found` (n,)."""
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        votes = 0
        for rays, u, v, w in ((x_rays, y, z, x), (y_rays, z, x, y), (z_rays, x, y, z)):
            low, high = _interval(rays, int(np.floor(u / rays.cell)), int(np.floor(v / rays.cell)), w)
            votes += low <= high
        found[n] = votes >= 2


@njit(cache=True, nogil=True)
def new_ends(now: RaySet, before: RaySet, step: int) -> ndarray:
    """The ends (u, v, w) of the material on every `step`-th ray either way that were no ends before."""
    found = np.empty((1024, 3))
    count = 0
    rows, columns = now.tile_of.shape
    for i in range(step // 2, rows * TILE, step):
        for j in range(step // 2, columns * TILE, step):
            tile = now.tile_of[i // TILE, j // TILE]
            if tile < 0:
                continue
            ray = (j % TILE) * TILE + i % TILE
            for k in range(2 * now.counts[tile, ray]):
                w = now.spans[tile, ray, k]
                known = False
                for m in range(2 * before.counts[tile, ray]):
                    known = known or before.spans[tile, ray, m] == w
                if known:
                    continue
                if count == len(found):
                    larger = np.empty((2 * count, 3))
                    larger[:count] = found
                    found = larger
                found[count, 0], found[count, 1], found[count, 2] = (
                    (i + 0.5) * now.cell,
                    (j + 0.5) * now.cell,
                    w,
                )
                count += 1
    return found[:count]
