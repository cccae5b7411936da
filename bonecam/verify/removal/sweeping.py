"""The material while a program runs: levels are swept one after the other, the three sets of rays side by
side."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.ndimage import distance_transform_edt

from bonecam.kernels.removal.bricks import (
    SAMPLES,
    WATCHED,
    Bricks,
    bound_clearances,
    mark_bricks,
)
from bonecam.kernels.removal.rays import RaySet
from bonecam.kernels.removal.sweep import Found, Pieces, sweep
from bonecam.runtime.threads import in_pieces
from bonecam.setup.stock import Stock
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.verify.removal.pieces import in_grid
from bonecam.verify.removal.rays import RayGrid, order, with_more_room

BRICK = 0.4
"""Side of the bricks, mm, in which tools are first looked at; larger where the box holds more than
MOST_BRICKS."""
MOST_BRICKS = 400_000
"""A distance transform of so many takes 0.05 s."""
BRICK_RAYS = 3
"""Every third ray either way marks the bricks."""
ALLOWED_TOUCH = -0.02
"""Signed distance of shank and holder from material that is no collision yet, mm: rays and steps tell it to
0.02."""
BOUNDED = 4096
"""Pieces whose clearances are bounded at once."""


class Sweeping:
    """Material that moves are taken out of; used for one program.

    `sets` are the rays along the three directions of `grid`, `found` what each has told so far.
    """

    def __init__(self, sets: Sequence[RaySet], grid: RayGrid, bodies: Sequence[Stock], moves: int) -> None:
        self.sets = list(sets)
        self.grid = grid
        corners = np.array([body.bounds for body in bodies])
        self.bounds: Float[ndarray, "2 3"] = np.array([corners[:, 0].min(0), corners[:, 1].max(0)])
        self.found = [
            Found(np.zeros(moves), np.full(2, WATCHED), np.full(2, -1), np.full(2, -1)) for _ in range(3)
        ]

    def run(self, pieces: Pieces, cutter: Cutter, beside: Callable[[Pieces], None]) -> Pieces:
        """Take the pieces of one cutter out of the material, in their order, while a core that has no set of
        rays to cut works on them `beside`; returns them with their `reach`."""
        heights = [
            (start - cutter.radius, end - cutter.radius, radius) for _, start, end, radius in cutter.sections
        ]
        sections = np.array(heights)
        least = np.max([found.least for found in self.found], axis=0)
        # flutes matter where they may meet material, the others where they may come nearer than they have
        bounded = _bounded(pieces, sections, np.r_[0.0, least], self._bricks())

        def work(which: slice) -> None:
            if which.start < len(self.sets):
                self._sweep(bounded, sections, which.start)
            else:
                beside(bounded)

        in_pieces(work, len(self.sets) + 1, 1)
        return bounded

    def _sweep(self, pieces: Pieces, sections: Float[ndarray, "3 3"], direction: int) -> None:
        """Take the pieces out of one set of rays, with more room on them where it is needed."""
        turned = in_grid(pieces, self.grid, direction)
        radius = float(sections[0, 2])
        found = self.found[direction]
        at = 0
        while at < len(pieces.starts):
            rays = self.sets[direction]
            at = sweep(rays, turned, radius, sections[1:], ALLOWED_TOUCH, at, found, direction)
            if at < len(pieces.starts):
                self.sets[direction] = with_more_room(rays)

    def _bricks(self) -> Bricks:
        """The bricks of the material that stands now."""
        extent = self.bounds[1] - self.bounds[0]
        size = max(BRICK, float(np.cbrt(extent.prod() / MOST_BRICKS)))
        corner = self.bounds[0] - size
        occupied = np.zeros(np.ceil(extent / size).astype(int) + 2, dtype=bool)
        for direction, rays in enumerate(self.sets):
            rotation = np.ascontiguousarray(self.grid.rotation[order(direction)])
            mark_bricks(rays, rotation, self.grid.corner, BRICK_RAYS, corner, size, occupied)
        spare = size / SAMPLES / 2 + BRICK_RAYS * self.grid.cell
        if occupied.any():
            distance = distance_transform_edt(~occupied) * size
        else:
            distance = np.full(occupied.shape, float(np.linalg.norm(extent)) + WATCHED)
        return Bricks(distance, corner, size, spare)

    @property
    def volumes(self) -> Float[ndarray, " n"]:
        """What each move has removed, the mean of the three sets, mm^3."""
        return np.mean([found.volumes for found in self.found], axis=0)

    def clearance(self, section: int) -> tuple[float, int]:
        """The least signed distance (mm) of the shank (0) or holder (1) from material, and its move (-1: more
        than WATCHED everywhere); of one that enters material that of the first move that does."""
        touching = [found for found in self.found if found.touched[section] >= 0]
        if touching:
            first = min(touching, key=lambda found: int(found.touched[section]))
            return float(first.least[section]), int(first.touched[section])
        best = min(self.found, key=lambda found: float(found.least[section]))
        return float(best.least[section]), int(best.where[section])

    def touched(self, section: int) -> int:
        """The first move in which the shank (0) or holder (1) enters material, -1 for none."""
        moves = [int(found.touched[section]) for found in self.found if found.touched[section] >= 0]
        return min(moves, default=-1)


def _bounded(
    pieces: Pieces, sections: Float[ndarray, "3 3"], watched: Float[ndarray, "3"], bricks: Bricks
) -> Pieces:
    """The pieces with what the bricks tell of flutes, shank and holder."""
    bounds = np.empty((len(pieces.starts), 3))
    near = np.empty((len(pieces.starts), 3, 2))

    def bound(some: slice) -> None:
        poses = (pieces.starts, pieces.ends, pieces.start_axes, pieces.end_axes)
        places = [pose[some] for pose in poses]
        bound_clearances(*places, sections, watched, bricks, bounds[some], near[some])

    in_pieces(bound, len(bounds), BOUNDED)
    reach = np.where(bounds[:, 0] < 0, near[:, 0, 1], 0.0)
    return pieces._replace(reach=reach, bounds=bounds[:, 1:].copy(), near=near[:, 1:].copy())
