"""What stands while the levels are machined, on three sets of rays (tri-dexels): what balls have left of the stock, and
what they would remove on other ways.

The height field of `material.py` knows the material along its own lines only: where the wall that a level leaves meets
a face of the stock that is not cut, a rib between two of them may be wider than a link may cut. Rays that cross one
another miss nothing that is wider than their distance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.removal.air import new_ends
from bonecam.kernels.removal.probe import cut_moves, probe
from bonecam.kernels.removal.rays import RaySet
from bonecam.runtime.threads import in_pieces
from bonecam.setup.stock import Stock
from bonecam.toolpath.engagement.rays import RayGrid, lay_grid, lay_rays, least_cell, order

CELL = 0.2
"""Distance of the rays, mm: eight of them meet a cube of which a link may remove no more."""
MEMORY_MB = 100.0
"""Memory that the rays may take; a larger stock has them farther apart."""


@dataclass(frozen=True, eq=False)
class Dexels:
    """What stands, on three sets of rays of a `grid`."""

    sets: tuple[RaySet, ...]
    grid: RayGrid

    def without(self, starts: Float[ndarray, "m 3"], ends: Float[ndarray, "m 3"], radius: float) -> "Dexels":
        """What is left behind straight moves of the centre of a ball."""
        left = [_copy_with_bounds(rays) for rays in self.sets]

        def work(which: slice) -> None:
            k = which.start
            places = self._in_set(starts, k), self._in_set(ends, k)
            at = 0
            while at < len(starts):
                at = cut_moves(left[k], *places, radius, at)
                if at < len(starts):
                    left[k] = with_more_room(left[k])

        in_pieces(work, len(left), 1)
        return Dexels(tuple(left), self.grid)

    @property
    def ends(self) -> Float[ndarray, "e 3"]:
        """Where the rays enter and leave the material."""
        found = []
        for k, rays in enumerate(self.sets):
            nothing = rays._replace(counts=np.zeros_like(rays.counts))
            places = new_ends(rays, nothing, 1)
            in_grid = np.empty_like(places)
            in_grid[:, order(k)] = places
            found.append(self.grid.in_part(in_grid))
        return np.vstack(found)

    def removed_by(
        self, lines: Sequence[Float[ndarray, "_ 3"]], removed: Float[ndarray, "k m 3"], radius: float
    ) -> Float[ndarray, " k"]:
        """What a ball would remove on straight moves of its centre through each line of places, mm^3, behind balls at
        the `removed` places of that line."""
        volumes = np.zeros((len(self.sets), len(lines)))
        if not len(lines):
            return volumes[0]
        places, ends = np.vstack(lines), np.cumsum([len(line) for line in lines])

        def work(which: slice) -> None:
            k, rays = which.start, self.sets[which.start]
            before = self._in_set(removed.reshape(-1, 3), k).reshape(removed.shape)
            at = 0
            while at < len(lines):
                at = probe(rays, self._in_set(places, k), ends, before, radius, at, volumes[k])
                if at < len(lines):
                    rays = with_more_room(rays)

        in_pieces(work, len(self.sets), 1)
        return np.asarray(volumes.mean(axis=0))

    def _in_set(self, points: Float[ndarray, "n 3"], direction: int) -> Float[ndarray, "n 3"]:
        """Points in the coordinates u, v, w of one set."""
        return np.ascontiguousarray(self.grid.of_points(points)[:, order(direction)])


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
