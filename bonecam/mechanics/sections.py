"""Slices of an upright body: area, centroid and second moments of each, of columns, meshes and ray sets.

A slice is even: what a cone or a leaning bone does within its 0.5 mm is left out. All that is at one height counts as
one section, also where it is in two pieces.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import numbered
from bonecam.kernels.removal.rays import TILE, RaySet
from bonecam.material.rays import RayGrid, order
from bonecam.mesh.triangle_mesh import TriangleMesh

SLICE = 0.5
"""Height of a slice, mm."""
LEAST_AREA = 4.0
"""Slices of a free end whose area is smaller are rigid, mm^2: the cap of a stock would bend without bound in its last
tenths of a millimetre."""
SHOULDER = 0.24
"""A shoulder between a round neck of the diameter d and a much wider piece gives way as so many d more of the neck:
with finite elements (linear elastic, bodies of revolution) 0.12 d where the wide piece has 1.5 d, 0.18 at 2 d, 0.22 at
3 d, 0.23 at 4 d, near 0.24 (1 - (d / D)^2). A rigid disc on a half space gives 0.26 d."""


@dataclass(frozen=True, eq=False)
class Sections:
    """Slices from `low` to `high` (n,) upwards, one on the other, mm: `area` (n,) mm^2, `centroid` (n, 2) mm, `second`
    moments of area about it (n, 2, 2) mm^4 (xx, xy; xy, yy), and the `flexible` length (n,) that bends, mm: 0 of a
    rigid slice; a shoulder has some, and no extent."""

    low: Float[ndarray, " n"]
    high: Float[ndarray, " n"]
    area: Float[ndarray, " n"]
    centroid: Float[ndarray, "n 2"]
    second: Float[ndarray, "n 2 2"]
    flexible: Float[ndarray, " n"]

    @property
    def z(self) -> Float[ndarray, " n"]:
        """Heights of the middles of the slices, mm."""
        return (self.low + self.high) / 2

    @property
    def rigid(self) -> int:
        """How many slices are taken as rigid."""
        return int(((self.flexible == 0) & (self.high > self.low)).sum())

    def between(self, low: float, high: float) -> "Sections":
        """The slices between two heights, those at the ends cut there."""
        kept = (self.high > low) & (self.low < high) | (self.low == self.high) & (low <= self.low) & (self.low <= high)
        whole = {each.name: getattr(self, each.name)[kept] for each in fields(self)}
        extent = whole["high"] - whole["low"]
        whole["low"], whole["high"] = np.maximum(whole["low"], low), np.minimum(whole["high"], high)
        share = np.where(extent > 0, (whole["high"] - whole["low"]) / np.where(extent > 0, extent, 1.0), 1.0)
        return Sections(**{**whole, "flexible": whole["flexible"] * share})


def column_sections(radius: float, low: float, high: float) -> Sections:
    """The slices of an upright cylinder about the Z axis, mm."""
    ends = _ends(low, high)
    count = len(ends) - 1
    area = np.full(count, np.pi * radius**2)
    second = np.broadcast_to(np.pi / 4 * radius**4 * np.eye(2), (count, 2, 2))
    return Sections(
        ends[:-1], ends[1:], area=area, centroid=np.zeros((count, 2)), second=second, flexible=np.diff(ends)
    )


def shoulder(diameter: float, height: float, wider: float = np.inf) -> Sections:
    """The shoulder between a round neck of a `diameter` and a piece of a `wider` one at a height, mm."""
    neck = column_sections(diameter / 2, height, height + SLICE)
    at = np.array([height])
    length = SHOULDER * diameter * (1 - min(diameter / wider, 1.0) ** 2)
    return Sections(at, at, area=neck.area, centroid=neck.centroid, second=neck.second, flexible=np.array([length]))


def join(pieces: Sequence[Sections]) -> Sections:
    """Pieces one on the other, the lowest first."""
    return Sections(*(np.concatenate([getattr(piece, each.name) for piece in pieces]) for each in fields(Sections)))


def mesh_sections(mesh: TriangleMesh, low: float | None = None, high: float | None = None) -> Sections:
    """The slices of a closed mesh between two heights (mm; None: its ends), each as at its middle."""
    bottom, top = mesh.bounds[:, 2]
    ends = _ends(float(bottom) if low is None else low, float(top) if high is None else high)
    planes = (ends[1:] + ends[:-1]) / 2
    heights = mesh.vertices[mesh.faces][:, :, 2]
    first = np.searchsorted(planes, heights.min(axis=1), side="right")
    last = np.searchsorted(planes, heights.max(axis=1), side="right")
    face, number = numbered(last - first)
    plane = first[face] + number
    corners = mesh.vertices[mesh.faces[face]]
    each = _polygon_moments(*_crossing(corners, planes[plane])).reshape(-1, 9)
    sums = np.column_stack([np.bincount(plane, entry, len(planes)) for entry in each.T])
    return _from_moments(ends, sums.reshape(-1, 3, 3))


def ray_sections(sets: Sequence[RaySet], grid: RayGrid, low: float, high: float) -> Sections:
    """The slices of what stands on rays between two heights, mm, each as the mean over its height and all sets."""
    ends = _ends(low, high)
    moments = [_ray_moments(rays, grid, direction, ends) for direction, rays in enumerate(sets)]
    return _from_moments(ends, np.mean(moments, axis=0) / np.diff(ends)[:, None, None])


def _ends(low: float, high: float) -> Float[ndarray, " n"]:
    """The ends of slices of SLICE at most, mm."""
    return np.linspace(low, high, max(int(np.ceil((high - low) / SLICE - 1e-9)), 1) + 1)


def _crossing(
    corners: Float[ndarray, "m 3 3"], planes: Float[ndarray, " m"]
) -> tuple[Float[ndarray, "m 2"], Float[ndarray, "m 2"]]:
    """Where level planes cross triangles that reach below and above them: x and y of start and end, the inside of an
    outward triangle to the left."""
    above = corners[:, :, 2] >= planes[:, None]
    # the corner that is alone on its side first
    alone = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)
    a, b, c = (corners[np.arange(len(corners)), (alone + k) % 3] for k in range(3))

    def meet(p: ndarray, q: ndarray) -> ndarray:
        share = (planes - p[:, 2]) / (q[:, 2] - p[:, 2])
        return p[:, :2] + share[:, None] * (q - p)[:, :2]

    one, other = meet(a, b), meet(a, c)
    up = above[np.arange(len(corners)), alone][:, None]
    return np.where(up, one, other), np.where(up, other, one)


def _polygon_moments(p: Float[ndarray, "m 2"], q: Float[ndarray, "m 2"]) -> Float[ndarray, "m 3 3"]:
    """Integrals of (1, x, y) (1, x, y)^T over the triangle from the origin to each edge p q."""
    corners = np.zeros((len(p), 3, 3))
    corners[:, :, 0] = 1.0
    corners[:, 1, 1:], corners[:, 2, 1:] = p, q
    twice = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    weights = (np.ones((3, 3)) + np.eye(3)) / 24
    return np.einsum("m,mai,ab,mbk->mik", twice, corners, weights, corners)


def _ray_moments(rays: RaySet, grid: RayGrid, direction: int, ends: Float[ndarray, " e"]) -> Float[ndarray, "n 3 3"]:
    """Integrals of (1, x, y) (1, x, y)^T over each slice of one set of rays, over its height.

    On all rays x and y grow alike with z, from a foot at z = 0. Of a slice that rays run through only the sums over
    their feet are needed; the slices in which a ray begins and ends are added ray by ray.
    """
    low, high = _material_ends(rays, grid, direction)
    rise = grid.rotation[direction]  # downwards where the material was turned over
    slope = rise / rise[2]
    met = (high[:, 2] > ends[0]) & (low[:, 2] < ends[-1])
    bottom, top = np.maximum(low[met, 2], ends[0]), np.minimum(high[met, 2], ends[-1])
    foot = (low - low[:, 2:] * slope)[met]
    foot[:, 2] = 0.0
    count = len(ends) - 1
    first = np.searchsorted(ends[1:-1], bottom, side="right")
    last = np.searchsorted(ends[1:-1], top, side="left")
    tall = last > first
    taller = last > first + 1

    def partly(slices: ndarray, start: ndarray, end: ndarray, feet: ndarray) -> Float[ndarray, "n 3 3"]:
        span = end - start
        moments = _binned(slices, feet + (start + end)[:, None] / 2 * slope, span, count)
        across = np.array([0.0, *slope[:2]])
        return moments + np.bincount(slices, span**3 / 12, count)[:, None, None] * np.outer(across, across)

    moments = partly(first, bottom, np.minimum(top, ends[first + 1]), foot)
    moments += partly(last[tall], ends[last[tall]], top[tall], foot[tall])

    through = _binned(first[taller] + 1, foot[taller], np.ones(taller.sum()), count)
    through = np.cumsum(through - _binned(last[taller], foot[taller], np.ones(taller.sum()), count), axis=0)
    return (moments + _risen(through, ends, slope)) * (grid.cell**2 / abs(rise[2]))


def _risen(
    feet: Float[ndarray, "n 3 3"], ends: Float[ndarray, " e"], slope: Float[ndarray, "3"]
) -> Float[ndarray, "n 3 3"]:
    """Integrals over whole slices of rays with these sums of (1, x, y) (1, x, y)^T over their feet."""
    middle = (ends[1:] + ends[:-1]) / 2
    height = np.diff(ends)
    shift = np.broadcast_to(np.eye(3), (len(middle), 3, 3)).copy()
    shift[:, 1:, 0] = middle[:, None] * slope[:2]
    across = np.array([0.0, *slope[:2]])
    within = (feet[:, 0, 0] * height**3 / 12)[:, None, None] * np.outer(across, across)
    return height[:, None, None] * (shift @ feet @ shift.transpose(0, 2, 1)) + within


def _binned(
    slices: Int[ndarray, " m"], points: Float[ndarray, "m 3"], weights: Float[ndarray, " m"], count: int
) -> Float[ndarray, "n 3 3"]:
    """The sums of weights times (1, x, y) (1, x, y)^T of the points of each slice."""
    ones = np.column_stack([np.ones(len(points)), points[:, :2]])
    sums = np.empty((count, 3, 3))
    for i in range(3):
        for k in range(i + 1):
            sums[:, i, k] = sums[:, k, i] = np.bincount(slices, weights * ones[:, i] * ones[:, k], count)
    return sums


def _material_ends(rays: RaySet, grid: RayGrid, direction: int) -> tuple[Float[ndarray, "m 3"], Float[ndarray, "m 3"]]:
    """The lower and the upper end of each piece of material on a set of rays, in the part's frame."""
    tiles = np.argwhere(rays.tile_of >= 0)
    tiles = tiles[np.argsort(rays.tile_of[tiles[:, 0], tiles[:, 1]])]
    room = rays.spans.shape[2] // 2
    tile, ray, piece = np.nonzero(np.arange(room) < rays.counts[:, :, None])
    ends = []
    for end in (2 * piece, 2 * piece + 1):
        local = np.empty((len(tile), 3))
        u, v, w = order(direction)
        local[:, u] = (tiles[tile, 0] * TILE + ray % TILE + 0.5) * rays.cell
        local[:, v] = (tiles[tile, 1] * TILE + ray // TILE + 0.5) * rays.cell
        local[:, w] = rays.spans[tile, ray, end]
        ends.append(grid.in_part(local))
    return (ends[0], ends[1]) if grid.rotation[direction, 2] > 0 else (ends[1], ends[0])


def _from_moments(ends: Float[ndarray, " e"], moments: Float[ndarray, "n 3 3"]) -> Sections:
    """Sections with these integrals of (1, x, y) (1, x, y)^T; small ones of the upper end are rigid."""
    area = np.maximum(moments[:, 0, 0], 0.0)
    centroid = moments[:, 0, 1:] / np.where(area > 0, area, 1.0)[:, None]
    second = moments[:, 1:, 1:] - area[:, None, None] * centroid[:, :, None] * centroid[:, None, :]
    flexible = np.diff(ends)
    solid = np.flatnonzero(area >= LEAST_AREA)
    flexible[solid[-1] + 1 if len(solid) else 0 :] = 0.0
    return Sections(ends[:-1], ends[1:], area=area, centroid=centroid, second=second, flexible=flexible)
