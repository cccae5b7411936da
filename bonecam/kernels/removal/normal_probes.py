"""Normal probes on a surface, cut by the capsules that a ball sweeps, compiled.

A normal probe stands on a point of the surface along its normal; its height is that of the lowest cut above the
surface. Where a ball went in it is negative: how deep the point lies in the ball. The chord of the probe would tell
more where the ball only grazes it, at a thin edge for example, where it comes from the other side.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.removal.rays import TINY


class ProbesByCell(NamedTuple):
    """Normal probes at `points` (n, 3) along unit `normals` in the order of their cells (i, j, k) of a grid of cubes of
    side `size` (mm) from `corner` on: those of a cell begin at cell_starts[i, j, k] and end where those of the next one
    begin."""

    points: ndarray
    normals: ndarray
    cell_starts: ndarray
    corner: ndarray
    size: float


class Capsules(NamedTuple):
    """Capsules of `radii` (c,) about the segments from `starts` to `ends` (c, 3), mm, and their `names` (c,)."""

    starts: ndarray
    ends: ndarray
    radii: ndarray
    names: ndarray


@inner_njit()
def _ball(px: float, py: float, pz: float, n: ndarray, square: float) -> tuple[float, float]:
    """Where a line through (px, py, pz), told from the ball's centre, along the unit n lies in the ball."""
    along = px * n[0] + py * n[1] + pz * n[2]
    rest = square - (px * px + py * py + pz * pz - along * along)
    if rest <= 0.0:
        return np.inf, -np.inf
    half = np.sqrt(rest)
    return -along - half, -along + half


@inner_njit()
def line_chord(p: ndarray, n: ndarray, start: ndarray, end: ndarray, radius: float) -> tuple[float, float]:
    """Where the line p + t n, n being unit, lies in a capsule: t; the first is larger where it misses."""
    square = radius * radius
    px, py, pz = p[0] - start[0], p[1] - start[1], p[2] - start[2]
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    low, high = _ball(px, py, pz, n, square)
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    if length <= 0.0:
        return low, high
    first, last = _ball(px - dx, py - dy, pz - dz, n, square)
    low, high = min(low, first), max(high, last)
    dx, dy, dz = dx / length, dy / length, dz / length
    turn = n[0] * dx + n[1] * dy + n[2] * dz
    along = px * dx + py * dy + pz * dz
    across = 1.0 - turn * turn
    if across > TINY:
        half = px * n[0] + py * n[1] + pz * n[2] - along * turn
        rest = half * half - across * (px * px + py * py + pz * pz - along * along - square)
        if rest > 0.0:
            root = np.sqrt(rest)
            first, last = (-half - root) / across, (-half + root) / across
            if 0.0 <= along + first * turn <= length:
                low = min(low, first)
            if 0.0 <= along + last * turn <= length:
                high = max(high, last)
    return low, high


@inner_njit()
def _distance(p: ndarray, start: ndarray, end: ndarray) -> float:
    """Distance of a point from a straight piece."""
    along, square = 0.0, 0.0
    for k in range(3):
        along += (p[k] - start[k]) * (end[k] - start[k])
        square += (end[k] - start[k]) ** 2
    share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    away = 0.0
    for k in range(3):
        away += (p[k] - start[k] - share * (end[k] - start[k])) ** 2
    return np.sqrt(away)


@njit(cache=True, nogil=True)
def cut_normal_probes(
    probes: ProbesByCell, reach: float, capsules: Capsules, heights: ndarray, owners: ndarray, from_top: bool
) -> None:
    """Lower `heights` (n,) to where capsules cut the normal probes, and set `owners` (n,) to the name of the one that
    did. `from_top`: only a capsule that holds the normal probe's upper end cuts it; what would hang over a cut stands.
    Cuts more than `reach` above the surface are left out.
    """
    points, normals, cell_starts, corner, size = probes
    starts, ends, radii, names = capsules
    shape = cell_starts.shape
    flat = cell_starts.ravel()
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for c in range(len(starts)):
        radius = radii[c]
        beside = False
        for k in range(3):
            least = min(starts[c, k], ends[c, k]) - radius - reach - corner[k]
            most = max(starts[c, k], ends[c, k]) + radius + reach - corner[k]
            low[k] = max(int(np.floor(least / size)), 0)
            high[k] = min(int(np.floor(most / size)), shape[k] - 1 - (k == 2))
            beside = beside or low[k] > high[k]
        if beside:
            continue
        half = 0.0
        mx = (starts[c, 0] + ends[c, 0]) / 2
        my = (starts[c, 1] + ends[c, 1]) / 2
        mz = (starts[c, 2] + ends[c, 2]) / 2
        for k in range(3):
            half += (ends[c, k] - starts[c, k]) ** 2 / 4
        ball = radius + np.sqrt(half)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                row = (i * shape[1] + j) * shape[2]
                for m in range(flat[row + low[2]], flat[row + high[2] + 1]):
                    # no point of the capsule is nearer to the nail's foot than this ball about its middle
                    far = (points[m, 0] - mx) ** 2 + (points[m, 1] - my) ** 2 + (points[m, 2] - mz) ** 2
                    if far >= (ball + max(heights[m], 0.0)) ** 2:
                        continue
                    enter, leave = line_chord(points[m], normals[m], starts[c], ends[c], radius)
                    lowest = heights[m] if from_top else 0.0
                    if enter < leave and leave > lowest and enter < heights[m]:
                        height = enter if enter > 0.0 else _distance(points[m], starts[c], ends[c]) - radius
                        if height < heights[m]:
                            heights[m] = height
                            owners[m] = names[c]


@njit(cache=True, nogil=True)
def useful_moves(
    probes: ProbesByCell, starts: ndarray, ends: ndarray, radius: float, least: float, heights: ndarray
) -> ndarray:
    """Whether each move (m,) lowers a normal probe by `least` at least, after those before it that do; they lower
    `heights` (n,). The normal probes are cut from the top."""
    points, normals, cell_starts, corner, size = probes
    reach = radius + heights.max()
    shape = cell_starts.shape
    flat = cell_starts.ravel()
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    useful = np.zeros(len(starts), dtype=np.bool_)
    for c in range(len(starts)):
        for k in range(3):
            nearest = min(starts[c, k], ends[c, k]) - reach - corner[k]
            farthest = max(starts[c, k], ends[c, k]) + reach - corner[k]
            low[k] = max(int(np.floor(nearest / size)), 0)
            high[k] = min(int(np.floor(farthest / size)), shape[k] - 1 - (k == 2))
        if high[2] < low[2]:
            continue
        for lowers in (False, True):
            for i in range(low[0], high[0] + 1):
                for j in range(low[1], high[1] + 1):
                    row = (i * shape[1] + j) * shape[2]
                    for m in range(flat[row + low[2]], flat[row + high[2] + 1]):
                        enter, leave = line_chord(points[m], normals[m], starts[c], ends[c], radius)
                        height = max(enter, 0.0)
                        if enter >= leave or leave <= heights[m] or height >= heights[m]:
                            continue
                        if lowers:
                            heights[m] = height
                        elif heights[m] - height >= least:
                            useful[c] = True
            if not useful[c]:
                break
    return useful


def probe_cells(points: ndarray, size: float) -> tuple[ndarray, ndarray, ndarray]:
    """The order (n,) of points (n, 3) by cells of side `size`, where each cell begins in it, and the corner of
    the first cell: as `ProbesByCell` has them."""
    corner = points.min(0)
    cells = np.floor((points - corner) / size).astype(np.int64)
    shape = cells.max(0) + 1
    flat = np.ravel_multi_index(tuple(cells.T), tuple(shape))
    counts = np.bincount(flat, minlength=int(shape.prod()))
    ends = np.cumsum(counts).reshape(tuple(shape))
    first = np.zeros((shape[0], shape[1], shape[2] + 1), dtype=np.int64)
    first[:, :, 1:] = ends
    first[:, :, 0] = np.r_[0, ends[:, :, -1].ravel()[:-1]].reshape(shape[0], shape[1])
    return np.argsort(flat, kind="stable"), first, corner
