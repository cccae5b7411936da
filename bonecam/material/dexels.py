"""What stands while the levels are machined, on three sets of rays (tri-dexels): what balls and the flutes above them
have left of the stock, and what they would remove on other ways.

The height field of `in_process_stock.py` knows the material along its own lines only: where the wall that a level
leaves meets a face of the stock that is not cut, a rib between two of them may be wider than a link may cut. Rays that
cross one another miss nothing that is wider than their distance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.removal.air import new_ends
from bonecam.kernels.removal.flutes import NO_BODY, Ways
from bonecam.kernels.removal.probe import cut_ways, probe
from bonecam.kernels.removal.rays import RaySet
from bonecam.material.rays import RayGrid, lay_grid, lay_rays, least_cell, order
from bonecam.runtime.threads import in_pieces
from bonecam.setup.stock import Stock

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

    def without(
        self, starts: Poses, ends: Poses, radius: float, reach: float = 0.0, body: Float[ndarray, "c 3"] = NO_BODY
    ) -> "Dexels":
        """What is left behind straight moves of a ball's centre, and of flutes up to `reach` (mm) above it; or of the
        `body` of a bull nose, as `Cutter.body` has it."""
        left = [_copy_with_bounds(rays) for rays in self.sets]

        def work(which: slice) -> None:
            k = which.start
            ways = self._ways(starts, ends, reach, k)._replace(body=body)
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
        ends = []
        for k, rays in enumerate(self.sets):
            nothing = rays._replace(counts=np.zeros_like(rays.counts))
            points = new_ends(rays, nothing, 1)
            in_grid = np.empty_like(points)
            in_grid[:, order(k)] = points
            ends.append(self.grid.in_part(in_grid))
        return np.vstack(ends)

    def removed_by(
        self,
        lines: Sequence[Poses],
        removed: Sequence[Poses],
        radius: float,
        reach: float = 0.0,
        body: Float[ndarray, "c 3"] = NO_BODY,
    ) -> Float[ndarray, " k"]:
        """What a ball, and flutes up to `reach` (mm) above its centre, would remove on straight moves through the poses
        of each line, mm^3, behind tools in the poses `removed` of that line; or the `body` of a bull nose."""
        volumes = np.zeros((len(self.sets), len(lines)))
        if not len(lines):
            return volumes[0]
        pairs = list(zip(removed, lines, strict=True))
        # each line begins at its first place, behind the tools that are there already
        starts = _stacked(
            [part for gone, line in pairs for part in (gone, _some(line, slice(1)), _some(line, slice(-1)))]
        )
        ends = _stacked([part for pair in pairs for part in pair])
        lasts = np.cumsum([len(gone[0]) + len(line[0]) for gone, line in pairs])
        begun = lasts - [len(line[0]) for _, line in pairs]

        def work(which: slice) -> None:
            k = which.start
            rays = self.sets[which.start]
            ways = self._ways(starts, ends, reach, k)._replace(body=body)
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
        return Ways(first, last, before, after, np.full(len(first), reach), NO_BODY)


def _some(poses: Poses, which: slice) -> Poses:
    """Some of the poses."""
    return poses[0][which], poses[1][which]


def _stacked(poses: Sequence[Poses]) -> Poses:
    """All poses, one behind the other."""
    centres, axes = zip(*poses, strict=True)
    return np.vstack(centres), np.vstack(axes)


def dexels_of(stock: Stock) -> Dexels:
    """The stock before the first cut."""
    grid = lay_grid([stock], CELL)
    grid = lay_grid([stock], max(CELL, least_cell([stock], grid, MEMORY_MB)))
    return Dexels(tuple(lay_rays([stock], grid, MEMORY_MB)), grid)


def _copy_with_bounds(rays: RaySet) -> RaySet:
    """A copy of the material that can be cut while the first one is still asked."""
    bounds = {name: getattr(rays, name).copy() for name in ("low", "high", "mask", "stale")}
    return copy_of(rays)._replace(**bounds)


def copy_of(rays: RaySet) -> RaySet:
    """A copy of the material; where rays lie, and the bounds of tiles, are shared."""
    return rays._replace(spans=rays.spans.copy(), counts=rays.counts.copy())


def with_more_room(rays: RaySet) -> RaySet:
    """A copy of the rays with room for twice as many intervals on a ray."""
    spans = np.zeros((*rays.spans.shape[:2], 2 * rays.spans.shape[2]), dtype=np.float32)
    spans[:, :, : rays.spans.shape[2]] = rays.spans
    return rays._replace(spans=spans)
