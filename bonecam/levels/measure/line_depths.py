"""How deep each cut is at single points: on the vertices of every level, and along one parameter line (Gan et
al. 2014, Fig. 11)."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.measure.level import Level, MorphLevel, PartLevel, RoundedLevel, morph_end, morph_surfaces
from bonecam.mesh.distance import MeshDistance, exact_closest
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline

LINE = 0.7
"""Parameter s of the line along which depths are drawn."""

POINTS = 1000
"""Points on the line."""


def step_depths(levels: Sequence[Level]) -> list[Float[ndarray, " n"]]:
    """For each level the distance of its mesh vertices to the level before it (its surface, not its mesh),
    mm; zero on the part."""
    return [
        np.zeros(len(levels[0].mesh.vertices)),
        *(depths_from(before, level.mesh.vertices) for before, level in pairwise(levels)),
    ]


def depths_from(before: Level, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Distances (mm) of points of a level to the level before it."""
    if isinstance(before, PartLevel | MorphLevel):
        return before.surface.project(points).distances
    return MeshDistance(before.mesh).unsigned(points)


def line_depths(
    levels: Sequence[Level], stock: Stock | None, s: float = LINE, points: int = POINTS
) -> Float[ndarray, "k points"]:
    """For each cut of the morph (rounding levels left out) the depth, mm, at points evenly spaced on the line
    s of its outer level.

    Depths are distances to the level before, not to the point of the same parameter, which may have slid
    along. The last cut's are from the places nearest to the line on the body that the morph ends at: the
    `stock` itself, or its surface where it was rounded. Open levels have no `stock` (None): theirs are from
    the mesh of the last level.
    """
    surfaces = morph_surfaces(levels)
    across, t = _on_line(surfaces[0], s, points)
    depths = [before.project(level.positions(across, t)).distances for before, level in pairwise(surfaces)]
    last = surfaces[-1].positions(across, t)
    end = morph_end(levels)
    if isinstance(end, RoundedLevel):
        ends = end.surface.project(last).points
    else:
        ends = stock.closest_points(last) if stock else exact_closest(levels[-1].mesh, last)[0]
    return np.vstack([*depths, surfaces[-1].project(ends).distances])


def line_lengths(surface: TSpline, s: float = LINE, points: int = POINTS) -> Float[ndarray, " points"]:
    """How far along the line s of a surface, mm, the points lie where `line_depths` takes its depths."""
    steps = np.diff(surface.positions(*_on_line(surface, s, points)), axis=0)
    return np.r_[0.0, np.linalg.norm(steps, axis=1).cumsum()]


def _on_line(surface: TSpline, s: float, points: int) -> tuple[ndarray, ndarray]:
    """Parameters of points evenly spaced on the line s."""
    (first, last), (low, high) = surface.domain
    if not first <= s <= last:
        raise ValueError(f"line = {s}: give a parameter from {first:g} to {last:g}")
    return np.full(points, float(s)), np.linspace(low, high, points)
