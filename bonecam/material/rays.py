"""The material as three sets of rays that cross one another (tri-dexels, Benouamer & Michelucci 1997): where
they lie, and convex bodies and closed meshes of any form on them.

The grid is turned so that its directions are even to the axis of the part: faces of a bar, which are parallel
to the coordinate axes, then lie across no set of rays, and no ray runs along one.

Of closed meshes there is material where they wind round a place more than once, so that solids may overlap, touch and
have hollows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, Int32
from numpy import ndarray
from scipy.spatial import ConvexHull

from bonecam.errors import JobError
from bonecam.kernels.hulls import find_crossings, polyhedron_chords
from bonecam.kernels.rays import TILE, RaySet, summarise
from bonecam.mesh.triangle_mesh import TriangleMesh, side_by_side
from bonecam.runtime.threads import in_pieces
from bonecam.setup.stock import Stock
from bonecam.setup.stocks.mesh import ConvexStock

ROOM = 4
"""Intervals on a ray to begin with: more are made room for where a cut needs them."""
CHORD = 0.02
"""Chord tolerance (mm) of the outline in which rays are laid."""
MARGIN = 0.5
"""The grid is larger than the stock by this much to each side, mm."""
AZIMUTH = np.radians(15.0)
"""Azimuth of the first direction: all three are then at least 15 degrees from the planes of X and of Y."""
SURE = 1e-6
"""Where a ray enters a body is found to this, mm: float32 has no more digits at 30 mm."""
MOST_STEPS = 80
"""Newton steps at most: where a ray grazes a body each step halves the distance that is left."""
PIECE = 512
"""Tiles whose rays are laid at once."""


@dataclass(frozen=True, eq=False)
class RayGrid:
    """The coordinates of the rays: a point of the part's frame is at rotation (p - corner), mm.

    `rotation` has the grid's directions as rows, `size` (3,) is the extent of the grid, `cell` the distance
    of rays.
    """

    rotation: Float[ndarray, "3 3"]
    corner: Float[ndarray, "3"]
    size: Float[ndarray, "3"]
    cell: float

    def move(self, pose: Float[ndarray, "4 4"]) -> "RayGrid":
        """The grid under a rigid transform (4, 4)."""
        corner = pose[:3, :3] @ self.corner + pose[:3, 3]
        return RayGrid(self.rotation @ pose[:3, :3].T, corner, self.size, self.cell)

    def of_points(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Points of the part's frame in the grid's coordinates."""
        return (points - self.corner) @ self.rotation.T

    def of_vectors(self, vectors: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Directions of the part's frame in the grid's."""
        return vectors @ self.rotation.T

    def in_part(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Points in the grid's coordinates in the part's frame."""
        return points @ self.rotation + self.corner


def order(direction: int) -> list[int]:
    """The grid's coordinates that are u, v and w of the rays along one of its directions."""
    return [(direction + 1) % 3, (direction + 2) % 3, direction]


def lay_grid(bodies: Sequence[Stock], cell: float) -> RayGrid:
    """The grid that holds all bodies."""
    return grid_round(np.vstack([body.mesh(CHORD).vertices for body in bodies]), cell)


def grid_round(points: Float[ndarray, "n 3"], cell: float) -> RayGrid:
    """The grid that holds all points, its directions even to the Z axis and 120 degrees apart about it."""
    azimuths = AZIMUTH + np.radians([0.0, 120.0, 240.0])
    flat = np.sqrt(2 / 3)
    rotation = np.column_stack([flat * np.cos(azimuths), flat * np.sin(azimuths), np.full(3, np.sqrt(1 / 3))])
    along = points @ rotation.T
    low = along.min(0) - MARGIN
    return RayGrid(rotation, low @ rotation, along.max(0) + MARGIN - low, cell)


def lay_rays(bodies: Sequence[Stock], grid: RayGrid, memory_mb: float) -> list[RaySet]:
    """The union of convex bodies on the three sets of rays; JobError where they and a copy need more memory."""
    fits = least_cell(bodies, grid, memory_mb)
    if grid.cell < fits:
        what = f"rays {grid.cell:g} mm apart need more than the {memory_mb:g} MB allowed"
        raise JobError(f"{what}: give a cell of at least {fits:.2f} mm", cell=fits)
    return [_lay_set(bodies, grid, k) for k in range(3)]


def least_cell(bodies: Sequence[Stock], grid: RayGrid, memory_mb: float) -> float:
    """The distance of rays (mm, in hundredths) that need no more memory, a copy of them included."""
    return cell_that_fits(sum(_outline(body, grid, k).volume for body in bodies for k in range(3)), memory_mb)


def cell_that_fits(area: float, memory_mb: float) -> float:
    """As `least_cell`, where the outlines of all bodies along the three directions have this area, mm^2."""
    return float(np.ceil(100 * np.sqrt(2 * area * (8 * ROOM + 1) / 1e6 / memory_mb)) / 100)


def _outline(body: Stock, grid: RayGrid, direction: int) -> ConvexHull:
    """The outline of a body, seen along a direction of the grid."""
    points = grid.of_points(body.mesh(CHORD).vertices)
    return ConvexHull(points[:, order(direction)[:2]])


def _empty_set(tile_of: Int32[ndarray, "i j"], room: int, grid: RayGrid, direction: int) -> RaySet:
    """A set of rays without material, with room for so many intervals on each ray of its tiles."""
    count = int(tile_of.max(initial=-1)) + 1
    return RaySet(
        tile_of,
        spans=np.zeros((count, TILE * TILE, 2 * room), dtype=np.float32),
        counts=np.zeros((count, TILE * TILE), dtype=np.uint8),
        low=np.zeros(count),
        high=np.zeros(count),
        mask=np.zeros(count, dtype=np.uint64),
        stale=np.zeros(count, dtype=bool),
        cell=grid.cell,
        length=float(grid.size[direction]),
    )


def _lay_set(bodies: Sequence[Stock], grid: RayGrid, direction: int) -> RaySet:
    """One set of rays, tile by tile where a body's outline is."""
    across = order(direction)
    side = TILE * grid.cell
    shape = np.ceil(grid.size[across[:2]] / side).astype(int)
    middles = [(np.arange(count) + 0.5) * side for count in shape]
    u, v = (x.ravel() for x in np.meshgrid(*middles, indexing="ij"))
    below = np.empty((len(u), len(bodies)), dtype=bool)
    for k, body in enumerate(bodies):
        outside = np.full(len(u), -np.inf)
        for a, b, c in _outline(body, grid, direction).equations:
            outside = np.maximum(outside, a * u + b * v + c)
        below[:, k] = outside <= side * np.sqrt(0.5) + CHORD
    met = below.any(1)
    below = below[met]
    tile_of = np.full(len(u), -1, dtype=np.int32)
    tile_of[met] = np.arange(met.sum())
    rays = _empty_set(tile_of.reshape(tuple(shape)), ROOM, grid, direction)

    # where rays enter and leave convex meshes: they are drawn in all tiles at once
    drawn = {}
    for k, body in enumerate(bodies):
        if isinstance(body, ConvexStock):
            low = np.full((len(below), TILE * TILE), -np.inf)
            high = np.full(low.shape, np.inf)
            corners = grid.of_points(body.surface.vertices)[:, across][body.surface.faces]
            polyhedron_chords(corners, grid.cell, rays.tile_of, low, high)
            drawn[k] = low, high

    corners = np.column_stack([u[met], v[met]]) - side / 2
    ray = np.arange(TILE * TILE)
    within = grid.cell * (np.column_stack([ray % TILE, ray // TILE]) + 0.5)
    along = grid.rotation[direction]

    def fill(tiles: slice) -> None:
        own = corners[tiles]
        points = np.zeros((len(own) * len(ray), 3))
        points[:, across[:2]] = (own[:, None] + within).reshape(-1, 2)
        starts = grid.in_part(points)
        low = np.full((len(starts), len(bodies)), np.inf)
        high = np.full((len(starts), len(bodies)), -np.inf)
        for k, body in enumerate(bodies):
            on_rays = np.flatnonzero(np.repeat(below[tiles, k], len(ray)))
            if k in drawn:
                enter, leave = (ends[tiles].ravel()[on_rays] for ends in drawn[k])
            else:
                enter = _entries(body, starts[on_rays], along, rays.length)
                leave = rays.length - _entries(body, starts[on_rays] + rays.length * along, -along, rays.length)
            hit = np.isfinite(enter) & np.isfinite(leave) & (enter < leave)
            low[on_rays[hit], k] = enter[hit]
            high[on_rays[hit], k] = leave[hit]
        _store(rays, tiles, low, high)

    in_pieces(fill, len(corners), PIECE)
    summarise(rays)
    return rays


def _store(rays: RaySet, tiles: slice, low: Float[ndarray, "n b"], high: Float[ndarray, "n b"]) -> None:
    """Write intervals, which may overlap or be empty, as their unions."""
    rows = np.arange(len(low))
    by_low = np.argsort(low, axis=1)
    spans = np.zeros((len(low), 2 * ROOM), dtype=np.float32)
    counts = np.zeros(len(low), dtype=np.uint8)
    for k in range(low.shape[1]):
        start, end = low[rows, by_low[:, k]], high[rows, by_low[:, k]]
        full = start < end
        last = np.maximum(counts.astype(int) - 1, 0)
        joins = full & (counts > 0) & (start <= spans[rows, 2 * last + 1])
        spans[rows[joins], 2 * last[joins] + 1] = np.maximum(spans[rows, 2 * last + 1], end)[joins]
        begins = full & ~joins
        spans[rows[begins], 2 * counts[begins]] = start[begins]
        spans[rows[begins], 2 * counts[begins] + 1] = end[begins]
        counts[begins] += 1
    rays.spans[tiles] = spans.reshape(-1, TILE * TILE, 2 * ROOM)
    rays.counts[tiles] = counts.reshape(-1, TILE * TILE)


def _entries(
    body: Stock, starts: Float[ndarray, "n 3"], along: Float[ndarray, "3"], length: float
) -> Float[ndarray, " n"]:
    """How far from its start, outside the body, each ray enters it; infinite where it passes by.

    The distance from a convex body is convex along a ray, so Newton's steps never pass the entry.
    """
    at = np.zeros(len(starts))
    distances = np.full(len(starts), np.inf)
    going = np.arange(len(starts))
    for _ in range(MOST_STEPS):
        distance, normals = body.distances_and_normals(starts[going] + at[going, None] * along)
        inside = distance <= SURE
        distances[going[inside]] = at[going[inside]]
        slope = normals @ along
        on: Bool[ndarray, " g"] = ~inside & (slope < 0)
        going = going[on]
        if not len(going):
            break
        at[going] -= distance[on] / slope[on]
        going = going[at[going] < length]
    return distances


def lay_solids(solids: Sequence[TriangleMesh], cell: float, memory_mb: float) -> tuple[list[RaySet], RayGrid]:
    """The union of closed outward meshes on three sets of rays `cell` mm apart, farther where they would need more
    memory; JobError where they hold nothing."""
    whole = side_by_side(solids)
    points = whole.vertices[np.unique(whole.faces)]
    grid = grid_round(points, cell)
    outlines = [ConvexHull(grid.of_points(points)[:, order(k)[:2]]).volume for k in range(3)]
    grid = grid_round(points, max(cell, cell_that_fits(sum(outlines), memory_mb)))
    return [_lay_solid_set(whole, grid, k) for k in range(3)], grid


def _lay_solid_set(whole: TriangleMesh, grid: RayGrid, direction: int) -> RaySet:
    """One set of rays, with the tiles in which any of them meets material."""
    columns = order(direction)
    corners = np.ascontiguousarray(grid.of_points(whole.vertices)[:, columns][whole.faces])
    tiles = np.ceil(grid.size[columns[:2]] / (TILE * grid.cell)).astype(int)
    shape = grid.cell, TILE * int(tiles[0]), TILE * int(tiles[1])
    count = find_crossings(corners, *shape, np.empty(0, np.int64), np.empty(0), np.empty(0, np.int8))
    ray = np.empty(count, dtype=np.int64)
    w = np.empty(count)
    into = np.empty(count, dtype=np.int8)
    find_crossings(corners, *shape, ray, w, into)
    ray, low, high = _material(ray, w, into)
    if not len(ray):
        raise JobError("the solids hold no material: give closed meshes whose normals face outward")

    # the stretches, which lie one behind the other on each ray, in the tiles that have any
    i, j = np.divmod(ray, shape[2])
    used, tile = np.unique(i // TILE * tiles[1] + j // TILE, return_inverse=True)
    within = j % TILE * TILE + i % TILE
    first = np.flatnonzero(np.diff(ray, prepend=-1))
    number = np.arange(len(ray)) - np.repeat(first, np.diff(np.r_[first, len(ray)]))
    tile_of = np.full(tiles[0] * tiles[1], -1, dtype=np.int32)
    tile_of[used] = np.arange(len(used))
    room = max(ROOM, int(number.max()) + 1)
    rays = _empty_set(tile_of.reshape(tuple(tiles)), room, grid, direction)
    rays.spans[tile, within, 2 * number], rays.spans[tile, within, 2 * number + 1] = low, high
    np.add.at(rays.counts, (tile, within), 1)
    summarise(rays)
    return rays


def _material(
    ray: Int[ndarray, " n"], w: Float[ndarray, " n"], into: Int[ndarray, " n"]
) -> tuple[Int[ndarray, " k"], Float[ndarray, " k"], Float[ndarray, " k"]]:
    """The ray and the two ends of each stretch of material: from where the solids begin to wind round a place until
    they no longer do."""
    along = np.lexsort((-into, w, ray))
    ray = ray[along]
    w = w[along]
    into = into[along].astype(np.int64)
    winding = np.cumsum(into)
    starts = np.flatnonzero(np.diff(ray, prepend=-1))
    before = np.r_[0, winding][starts]
    winding = winding - np.repeat(before, np.diff(np.r_[starts, len(ray)]))
    was = winding - into
    begins, ends = np.flatnonzero((was <= 0) & (winding > 0)), np.flatnonzero((was > 0) & (winding <= 0))
    if winding[np.r_[starts[1:], len(ray)] - 1].any():
        raise JobError("a solid is not closed: give closed meshes")
    return ray[begins], w[begins], w[ends]
