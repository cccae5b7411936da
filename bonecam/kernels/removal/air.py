"""How far places in material are from air, compiled, on three sets of rays that cross one another."""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.closest.triangle_tree import squared_triangle_distance
from bonecam.kernels.removal.rays import TILE, RaySet

FINE = 5
"""A search disc is first looked at on rays this many to its radius, then on all rays about the best one."""
STEEPEST = 1.5
"""Ends on neighbouring rays are of one face of the material where they differ by this many cells at most: of three sets
that cross, one meets each face so."""


@inner_njit()
def _ray_at(rays: RaySet, i: int, j: int) -> tuple[int, int]:
    """The tile of ray (i, j) and the ray's index in it; the tile is negative where there is no such ray, or never was
    material on it."""
    rows, columns = rays.tile_of.shape
    if i < 0 or j < 0 or i >= rows * TILE or j >= columns * TILE:
        return -1, 0
    return rays.tile_of[i // TILE, j // TILE], (j % TILE) * TILE + i % TILE


@inner_njit()
def _interval(rays: RaySet, i: int, j: int, w: float) -> tuple[float, float]:
    """The interval of material that holds w on ray (i, j); the first end is larger where w is in air."""
    tile, ray = _ray_at(rays, i, j)
    for k in range(rays.counts[tile, ray] if tile >= 0 else 0):
        low, high = rays.spans[tile, ray, 2 * k], rays.spans[tile, ray, 2 * k + 1]
        if low <= w <= high:
            return low, high
    return 1.0, 0.0


@inner_njit()
def _on_ray(rays: RaySet, i: int, j: int, u: float, v: float, w: float) -> float:
    """Squared distance from (u, v, w) to the nearest air on ray (i, j)."""
    x, y = (i + 0.5) * rays.cell - u, (j + 0.5) * rays.cell - v
    low, high = _interval(rays, i, j, w)
    along = min(w - low, high - w) if low <= high else 0.0
    return x * x + y * y + along * along


@inner_njit()
def _end_beside(rays: RaySet, i: int, j: int, w: float, high: bool) -> float:
    """The upper (`high`) or lower end of material on ray (i, j) that continues a face from height w; NaN where none
    does."""
    tile, ray = _ray_at(rays, i, j)
    for k in range(rays.counts[tile, ray] if tile >= 0 else 0):
        end = rays.spans[tile, ray, 2 * k + high]
        if abs(end - w) <= STEEPEST * rays.cell:
            return end
    return np.nan


@inner_njit()
def _on_face(rays: RaySet, i: int, j: int, u: float, v: float, w: float) -> float:
    """Squared distance from (u, v, w) to the nearest of the triangles between the nearer end of the material on ray
    (i, j) and those beside it; infinite where there are none, or the ray is in air."""
    cell = rays.cell
    low, high = _interval(rays, i, j, w)
    if low > high:
        return np.inf
    upper = high - w < w - low
    corners = np.empty(9)
    corners[0], corners[1], corners[2] = (i + 0.5) * cell, (j + 0.5) * cell, high if upper else low
    corners[4], corners[6] = corners[1], corners[0]
    before = _end_beside(rays, i, j - 1, corners[2], upper)
    behind = _end_beside(rays, i, j + 1, corners[2], upper)
    best = np.inf
    for a in (-1, 1):
        corners[3], corners[5] = corners[0] + a * cell, _end_beside(rays, i + a, j, corners[2], upper)
        for b, end in ((-1, before), (1, behind)):
            corners[7], corners[8] = corners[1] + b * cell, end
            if not (np.isnan(corners[5]) or np.isnan(end)):
                best = min(best, squared_triangle_distance(u, v, w, corners))
    return best


@njit(cache=True, nogil=True)
def _nearest(rays: RaySet, u: float, v: float, w: float, best: float) -> float:
    """The smaller of `best` and the squared distance from (u, v, w) to air, found on one set: on its rays, then on the
    face between the ends about the nearest one."""
    cell = rays.cell
    i, j = int(np.floor(u / cell)), int(np.floor(v / cell))
    near = _on_ray(rays, i, j, u, v, w)
    at_i, at_j = i, j
    step = max(int(np.sqrt(min(near, best)) / (FINE * cell)), 1)
    count = int(np.sqrt(min(near, best)) / (step * cell)) + 1
    for a in range(-count, count + 1):
        for b in range(-count, count + 1):
            if (a * a + b * b) * (step * cell) ** 2 > 2 * min(near, best):
                continue
            squared = _on_ray(rays, i + a * step, j + b * step, u, v, w)
            if squared < near:
                near = squared
                at_i = i + a * step
                at_j = j + b * step
    middle_i, middle_j = at_i, at_j
    for a in range(1 - step, step):
        for b in range(1 - step, step):
            squared = _on_ray(rays, middle_i + a, middle_j + b, u, v, w)
            if squared < near:
                near = squared
                at_i = middle_i + a
                at_j = middle_j + b
    return min(best, near, _on_face(rays, at_i, at_j, u, v, w))


@inner_njit()
def air_on_set(rays: RaySet, u: float, v: float, w: float) -> float:
    """Distance from (u, v, w) to the nearest air on one set, mm; 0 on a ray in air."""
    return np.sqrt(_nearest(rays, u, v, w, np.inf))


@njit(cache=True, nogil=True)
def air_distances(x_rays: RaySet, y_rays: RaySet, z_rays: RaySet, points: ndarray, found: ndarray) -> None:
    """Write the distance of each point (n, 3) (grid's coordinates) from the nearest air into `found` (n,),
    mm; in air that to a ray, half of the diagonal of a cell at most."""
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
    ends = np.empty((1024, 3))
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
                if count == len(ends):
                    larger = np.empty((2 * count, 3))
                    for m in range(count):
                        for n in range(3):
                            larger[m, n] = ends[m, n]
                    ends = larger
                ends[count, 0], ends[count, 1], ends[count, 2] = ((i + 0.5) * now.cell, (j + 0.5) * now.cell, w)
                count += 1
    return ends[:count]
