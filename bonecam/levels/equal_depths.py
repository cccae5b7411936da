"""Levels of even depth: as many as the given depths need, the outermost no sliver."""

from dataclasses import replace
from typing import Any

from bonecam.levels.edge_rounding import begin_levels
from bonecam.levels.sequences.begun_morph import Morph
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
    """The levels of `levels_in` with roughing cuts so shallow that the morph's outermost cut is as deep as they are.

    The number of cuts is that of the given depths; where shallower cuts need one more, the depth is raised again
    half way, at last to what was given. Only the levels that are kept are measured.
    """
    given = begin_levels(surface, stock, schedule, **options)
    cuts, rest = len(given.morph.first), given.morph.rest
    if rest >= ENOUGH * schedule.limit(cuts):
        return given.measured()
    depth = SPARE * even_out(schedule, given.morph.distance, cuts, rest).beyond
    for _ in range(TRIES):
        if depth >= schedule.beyond:
            break
        tried = begin_levels(surface, stock, Schedule(schedule.first, depth), **options)
        if tried.cuts <= given.cuts and len(tried.morph.first) <= cuts:
            return replace(tried.measured(), lower_bound=given.lower_bound(schedule))
        depth = (depth + schedule.beyond) / 2
    return given.measured()
