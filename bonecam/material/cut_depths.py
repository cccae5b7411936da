"""Depth of cut: how far the nearest air was from each place of the surface that a level leaves, when it
began."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.removal.air import air_distances, new_ends
from bonecam.kernels.removal.rays import RaySet
from bonecam.kernels.removal.sweep import Pieces
from bonecam.material.rays import RayGrid, order
from bonecam.runtime.threads import in_pieces

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
    points_of_sets = []
    for direction in range(3):
        ends = new_ends(now[direction], before[direction], step)
        points = np.empty_like(ends)
        points[:, order(direction)] = ends
        points_of_sets.append(points)
    points = np.vstack(points_of_sets)
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
