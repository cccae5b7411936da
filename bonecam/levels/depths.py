"""How deep each cut is at single points: on the vertices of every level, and along one parameter line (Gan et al. 2014, Fig. 11)."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.level import Level
from bonecam.levels.stock import Stock
from bonecam.mesh.distance import MeshDistance

LINE, POINTS = 0.7, 1000


def step_depths(levels: Sequence[Level]) -> list[Float[ndarray, " n"]]:
    """For each level the distance of its mesh vertices to the level before it (its surface, not its mesh), mm; zero on the part."""
    return [np.zeros(len(levels[0].mesh.vertices)), *(depths_from(before, level.mesh.vertices) for before, level in pairwise(levels))]


def depths_from(before: Level, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Distances (mm) of points of a level to the level before it."""
    if before.surface is None or before.within is not None:
        return MeshDistance(before.mesh).unsigned(points)
    return before.surface.project(points).distances


def line_depths(levels: Sequence[Level], stock: Stock, s: float = LINE, points: int = POINTS) -> Float[ndarray, "k points"]:
    """For each cut of the morph (rounding levels left out) the depth, mm, at points evenly spaced on the line s of its outer level.

    Depths are distances to the level before, not to the point of the same parameter, which may have slid along. The last cut's are
    from the places nearest to the line on the body that the morph ends at: the `stock` itself, or its surface where it was rounded.
    """
    surfaces = [level.surface for level in levels if level.within is None and level.surface is not None]
    low, high = surfaces[0].domain[1]
    t, across = np.linspace(low, high, points), np.full(points, s)
    found = [before.project(level.positions(across, t)).distances for before, level in pairwise(surfaces)]
    last, body = surfaces[-1].positions(across, t), levels[len(surfaces)].surface
    ends = stock.nearest(last) if body is None else body.project(last).feet
    return np.vstack([*found, surfaces[-1].project(ends).distances])
