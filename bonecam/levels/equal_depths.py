"""Levels of even depth: as many as the given depths need, the outermost no sliver."""

from dataclasses import replace
from typing import Any

from bonecam.levels.closed_morph import Morph
from bonecam.levels.edge_rounding import levels_in
from bonecam.levels.measure.level import morph_end
from bonecam.mesh.distance import MeshDistance
from bonecam.setup.schedule import Schedule, even_out
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline

TRIES = 3
"""Depths that are tried before the given ones are kept."""
SPARE = 1.004
"""The first is deeper than even cuts by this factor: levels use a little less than all of their depth."""
ENOUGH = 0.9
"""An outermost cut that uses this share of its depth is even enough."""


def even_levels(surface: TSpline, stock: Stock, schedule: Schedule, **options: Any) -> Morph:
    """`levels_in`, then again with roughing cuts so shallow that the morph's outermost cut is as deep as they
    are.

    The number of cuts stays; where shallower cuts need one more, the depth is raised again half way, at last
    to what was given.
    """
    made = levels_in(surface, stock, schedule, **options)
    cuts, rest = _outermost(made)
    distance = float(MeshDistance(made.levels[0].mesh).unsigned(made.levels[cuts].mesh.vertices).max())
    if rest >= ENOUGH * schedule.limit(cuts):
        return made
    even = even_out(schedule, distance, cuts, rest)
    depth, best = min(schedule.beyond, SPARE * even.beyond), made
    for _ in range(TRIES):
        if depth >= schedule.beyond:
            break
        tried = levels_in(surface, stock, Schedule(schedule.first, depth), **options)
        if tried.cuts <= made.cuts and _outermost(tried)[0] <= cuts:
            best = replace(tried, lower_bound=made.lower_bound)
            break
        depth = (depth + schedule.beyond) / 2
    return best


def _outermost(made: Morph) -> tuple[int, float]:
    """Index of the body the morph ends at, and how deep its cut is; rounding levels come behind it."""
    last = morph_end(made.levels)
    return last.index, last.depth_max
