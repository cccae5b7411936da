"""What stands while the levels are machined, on three sets of rays (tri-dexels): what balls and the flutes above them
have left of the stock, and what they would remove on other ways.

The height field of `in_process_stock.py` knows the material along its own lines only: where the wall that a level
leaves meets a face of the stock that is not cut, a rib between two of them may be wider than a link may cut. Rays that
cross one another miss nothing that is wider than their distance.

The depth of a cut is how far the nearest air was from each place of the surface that it leaves, when it began; that of
a ball, how deep it enters the surface of what stands.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import numbered
from bonecam.kernels.bodies import Ways
from bonecam.kernels.rays import RaySet, air_distances, new_ends
from bonecam.kernels.removal import Pieces, cut_ways, probe
from bonecam.material.rays import RayGrid, lay_grid, lay_rays, least_cell, order
from bonecam.mesh.distance import MeshDistance
from bonecam.runtime.threads import in_pieces
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath

CELL = 0.2
"""Distance of the rays, mm: eight of them meet a cube of which a link may remove no more."""
MEMORY_MB = 100.0
"""Memory that the rays may take; a larger stock has them farther apart."""

Poses = tuple[Float[ndarray, "_ 3"], Float[ndarray, "_ 3"]]
"""Ball centres and unit tool axes."""


@dataclass(frozen=True, eq=False)
class Dexels:
    """What stands, on three sets of rays of a `grid`."""

    sets: tuple[RaySet, ...]
    grid: RayGrid

    def without(self, starts: Poses, ends: Poses, radius: float, reach: float = 0.0) -> "Dexels":
        """What is left behind straight moves of a ball's centre, and of flutes up to `reach` (mm) above it."""
        left = [copy_of(rays) for rays in self.sets]

        def work(which: slice) -> None:
            k = which.start
            ways = self._ways(starts, ends, reach, k)
            at = 0
            while at < len(ways.starts):
                at = cut_ways(left[k], ways, radius, at)
                if at < len(ways.starts):
                    left[k] = with_more_room(left[k])

        in_pieces(work, len(left), 1)
        return Dexels(tuple(left), self.grid)

    @property
    def ends(self) -> Float[ndarray, "e 3"]:
        """Where the rays enter and leave the material."""
        nothing = [rays._replace(counts=np.zeros_like(rays.counts)) for rays in self.sets]
        return np.vstack([self.grid.in_part(points) for points in _new_ends(self.sets, nothing, 1)])

    def removed_by(
        self, lines: Sequence[Poses], removed: Sequence[Poses], radius: float, reach: float = 0.0
    ) -> Float[ndarray, " k"]:
        """What a ball, and flutes up to `reach` (mm) above its centre, would remove on straight moves through the poses
        of each line, mm^3, behind tools in the poses `removed` of that line."""
        volumes = np.zeros((len(self.sets), len(lines)))
        if not len(lines):
            return volumes[0]
        pairs = list(zip(removed, lines, strict=True))
        starts, ends = [], []
        for part in range(2):
            ends.append(np.vstack([poses[part] for pair in pairs for poses in pair]))
            # each line begins at its first place, behind the tools that are there already
            before = [(gone[part], line[part][:1], line[part][:-1]) for gone, line in pairs]
            starts.append(np.vstack([poses for each in before for poses in each]))
        lasts = np.cumsum([len(gone[0]) + len(line[0]) for gone, line in pairs])
        begun = lasts - [len(line[0]) for _, line in pairs]

        def work(which: slice) -> None:
            k = which.start
            rays = self.sets[k]
            ways = self._ways((starts[0], starts[1]), (ends[0], ends[1]), reach, k)
            at = 0
            while at < len(lines):
                at = probe(rays, ways, ends=lasts, gone=begun, radius=radius, first=at, volumes=volumes[k])
                if at < len(lines):
                    rays = with_more_room(rays)

        in_pieces(work, len(self.sets), 1)
        return volumes.mean(axis=0)

    def _ways(self, starts: Poses, ends: Poses, reach: float, direction: int) -> Ways:
        """Straight moves of a tool in the coordinates of one set."""
        across = order(direction)
        first, last = (np.ascontiguousarray(self.grid.of_points(c)[:, across]) for c, _ in (starts, ends))
        before, after = (np.ascontiguousarray(self.grid.of_vectors(v)[:, across]) for _, v in (starts, ends))
        return Ways(first, last, before, after, np.full(len(first), reach))


def copy_of(rays: RaySet) -> RaySet:
    """A copy of the material that can be cut while the first one is still asked."""
    copied = "spans", "counts", "low", "high", "mask", "stale"
    return rays._replace(**{name: getattr(rays, name).copy() for name in copied})


def with_more_room(rays: RaySet) -> RaySet:
    """A copy of the rays with room for twice as many intervals on a ray."""
    return rays._replace(spans=np.concatenate([rays.spans, np.zeros_like(rays.spans)], axis=2))


def _new_ends(now: Sequence[RaySet], before: Sequence[RaySet], step: int) -> list[Float[ndarray, "_ 3"]]:
    """As the kernel, of each of three sets of rays, in the grid's coordinates."""
    found = []
    for k in range(3):
        ends = new_ends(now[k], before[k], step)
        points = np.empty_like(ends)
        points[:, order(k)] = ends
        found.append(points)
    return found


DENSE = 0.25
"""Depths on a move are measured no farther apart, mm, as the places of the material are."""


def move_depths(
    depths: Callable[[ndarray, float], tuple[ndarray, ndarray]],
    starts: Float[ndarray, "m 3"],
    ends: Float[ndarray, "m 3"],
    radius: float,
) -> Float[ndarray, " m"]:
    """The largest depth (mm) of a ball between start and end of each move of its centre, both left out; 0 where it
    enters nothing there. `depths` are those of a material at given centres."""
    counts = np.ceil(np.linalg.norm(ends - starts, axis=1) / DENSE).astype(np.int64) - 1
    counts = np.maximum(counts, 0)
    move, place = numbered(counts)
    share = ((place + 1) / (counts[move] + 1))[:, None]
    deepest = np.zeros(len(starts))
    np.maximum.at(deepest, move, depths((1 - share) * starts[move] + share * ends[move], radius)[0])
    return deepest


@dataclass(frozen=True, eq=False)
class CutDexels:
    """What `balls` alone have left, and what whole `cutters`, balls and the flutes above them, have left."""

    balls: Dexels
    cutters: Dexels

    def after(self, path: ToolPath) -> "CutDexels":
        """What is left behind the cuts of a path."""
        starts, ends = cut_poses(path)
        if not len(ends[0]):
            return self
        radius, reach = path.cutter.radius, path.cutter.reach
        cutters = self.cutters.without(starts, ends, radius, reach)
        return CutDexels(self.balls.without(starts, ends, radius), cutters)

    def cut_little(
        self, lines: Sequence[Poses], removed: Sequence[Poses], cutter: Cutter, allowed: Float[ndarray, " k"]
    ) -> Bool[ndarray, " k"]:
        """Whether neither the ball alone nor ball and flutes remove more than is `allowed` (mm^3) on straight moves
        through the poses of each line, behind tools in the poses `removed` of that line."""
        little = self.balls.removed_by(lines, removed, cutter.radius) <= allowed
        asked = np.flatnonzero(little).tolist()
        lines, removed = [lines[k] for k in asked], [removed[k] for k in asked]
        little[asked] = self.cutters.removed_by(lines, removed, cutter.radius, cutter.reach) <= allowed[asked]
        return np.asarray(little)


def uncut_rays(stock: Stock) -> CutDexels:
    """The stock before the first cut."""
    grid = lay_grid([stock], CELL)
    grid = lay_grid([stock], max(CELL, least_cell([stock], grid, MEMORY_MB)))
    dexels = Dexels(tuple(lay_rays([stock], grid, MEMORY_MB)), grid)
    return CutDexels(dexels, dexels)


def cut_poses(path: ToolPath) -> tuple[Poses, Poses]:
    """Ball centre and axis at beginning and end of each cutting move; a pass begins with one of no length."""
    centres = path.balls
    cutting = path.kinds == MoveKind.CUT
    goes_on = np.r_[False, cutting[:-1] & (path.pass_index[1:] == path.pass_index[:-1])]
    before = (np.arange(len(centres)) - goes_on)[cutting]
    return (centres[before], path.axes[before]), (centres[cutting], path.axes[cutting])


SPACING = 0.2
"""Depths are measured this far apart, mm, on each set of rays."""
MEASURED = 2048
"""Places measured at once."""


@dataclass(frozen=True, eq=False)
class Depths:
    """Places (n, 3) of the surface that was cut, in the part's frame, and the depth of the cut there (n,),
    mm."""

    places: Float[ndarray, "n 3"]
    depths: Float[ndarray, " n"]

    @property
    def deepest(self) -> int:
        """The index of the deepest place."""
        return int(np.argmax(self.depths))


def cut_depths(now: Sequence[RaySet], before: Sequence[RaySet], grid: RayGrid, spacing: float = SPACING) -> Depths:
    """The depths of all that was cut between `before` and `now`, at places `spacing` mm apart on each set of rays.

    A place counts once for each set of rays that ends there, so that slanted places count up to sqrt(3)
    times.
    """
    step = max(round(spacing / grid.cell), 1)
    points = np.vstack(_new_ends(now, before, step))
    depths = np.empty(len(points))

    def measure(some: slice) -> None:
        air_distances(*before, points[some], depths[some])

    in_pieces(measure, len(points), MEASURED)
    return Depths(grid.in_part(points), depths)


def move_through(place: Float[ndarray, "3"], pieces: Pieces, radius: float) -> int:
    """The move whose ball left the surface at `place`: it passes nearest to it."""
    along = pieces.ends - pieces.starts
    square = np.maximum((along**2).sum(1), np.finfo(float).tiny)
    share = np.clip(((place - pieces.starts) * along).sum(1) / square, 0.0, 1.0)
    away = np.linalg.norm(pieces.starts + share[:, None] * along - place, axis=1)
    return int(pieces.moves[np.argmin(np.abs(away - radius))])


def ball_depths(
    surface: MeshDistance, centres: Float[ndarray, "n 3"], radius: float
) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
    """How deep a ball of this radius at each centre enters a closed surface (mm; negative: it is off), and the unit
    direction out of it at the nearest place."""
    points, _ = surface.closest(centres)
    outward = np.where(surface.inside(centres), -1.0, 1.0)
    distance = outward * np.linalg.norm(centres - points, axis=1)
    return radius - distance, (centres - points) / np.where(distance, distance, np.inf)[:, None]


def enters_beside(
    places: KDTree,
    deep: Float[ndarray, " n"],
    outward: Float[ndarray, "n 3"],
    centres: Float[ndarray, "n 3"],
    contacts: Float[ndarray, "n 3"],
    radius: float,
    depth: float,
) -> Bool[ndarray, " n"]:
    """Whether balls that are `deep` in material with these `places`, which is left along `outward`, enter it by more
    than `depth` (mm) where a ball at their contact has not been."""
    entered = deep > depth
    which = np.flatnonzero(entered)
    nearest = centres - (radius - deep)[:, None] * outward
    for i, near in zip(which, places.query_ball_point(centres[which], radius - depth), strict=True):
        here = np.vstack([nearest[i], places.data[near]])
        entered[i] = bool((np.linalg.norm(here - contacts[i], axis=1) > radius).any())
    return np.asarray(entered)
