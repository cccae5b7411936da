"""The part's T-spline with more control points, for its levels: the same surface on a refine_for_depth T-mesh (exact
knot insertion, Boehm 1980).

Where part of a level lies at the stock's wall already and the rest still moves there is a rim between, which
wanders over all of the surface from level to level. Within about a span of it a T-spline rounds it off, and
depth is lost; so no span may be much longer than a cut is deep. Spans are measured on the stock, at the
nearest points, where levels end.
"""

from itertools import pairwise

import numpy as np
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.setup.stock import Stock
from bonecam.surface.refinement.row_refinement import with_row_knots
from bonecam.surface.tspline import TSpline

IN_CAPSULES = (14.0, 800, 3000)
WITH_FLATS = (6.5, 1000, 1000)
COARSER = 1.25
"""So many depths long may spans be, of surfaces of fewer than so many control points, of so many at most: in
a capsule, and in a stock with flats, which a level reaches long before the edges between them. So much
longer, and again, where that would take more control points. Where spans are too long for what is left, levels
stall: a whole femur's reach the stock with 2,566 control points, not with 1,500. Shorter spans follow hollows that
no cutter enters."""
STRETCHED = 4.0
"""Neighbours on both sides of the stock's axis have their nearest points on the stock far apart, however near
they are."""
AROUND = 64
"""Lines round the surface on which the distance between two rows is taken; their mean counts."""
ALONG = 4
"""Pieces in which the length of a span is taken."""


def refine_for_depth(surface: TSpline, stock: Stock, depth: float) -> TSpline:
    """The surface with spans halved until they are short enough for cuts so deep (mm); one that has many
    control points as it is."""
    depths, few, most = WITH_FLATS if stock.has_flats else IN_CAPSULES
    longest = depths * depth
    while surface.tmesh.size < few:
        refined = _across(_along(surface, stock, longest, most), stock, longest, most)
        if refined.tmesh.size <= most:
            return refined
        longest *= COARSER
    return surface


def _along(surface: TSpline, stock: Stock, longest: float, most: int) -> TSpline:
    """Rows between rows that are farther apart, in the mean, than `longest` mm."""
    s = np.repeat(np.arange(AROUND) / AROUND, ALONG + 1)
    while True:
        knots = np.unique(surface.tmesh.t_knots)
        lines = (np.tile(np.linspace(low, high, ALONG + 1), AROUND) for low, high in pairwise(knots))
        long = np.array([_length(surface, stock, s, t).mean() for t in lines]) > longest
        if surface.tmesh.size > most or not long.any():
            return surface
        t = ((knots[:-1] + knots[1:]) / 2)[long]
        surface = surface.refine(np.zeros(len(t)), t, "t")


def _across(surface: TSpline, stock: Stock, longest: float, most: int) -> TSpline:
    """Knots in the intervals of rows that are longer than `longest` mm."""
    (low, high) = surface.domain[1]
    t_knots = surface.tmesh.t_knots
    while True:
        fresh = []
        for j, knots in enumerate(surface.tmesh.s_knots):
            step = np.diff(knots, append=knots[0] + 1)
            s = (knots[:, None] + step[:, None] * np.linspace(0, 1, ALONG + 1)).ravel()
            t = np.full(len(s), np.clip(t_knots[j + 1 : j + 4].mean(), low, high))
            long = (_length(surface, stock, s, t) > longest) & (len(knots) > 1)
            fresh.append(np.mod(knots + step / 2, 1.0)[long])
        if surface.tmesh.size > most or not any(len(knots) for knots in fresh):
            return surface
        surface = with_row_knots(surface, fresh)


def _length(surface: TSpline, stock: Stock, s: ndarray, t: ndarray) -> ndarray:
    """Lengths, mm, of lines on the surface as they lie on the stock, but STRETCHED times their own at most:
    each of ALONG pieces, with its ends among s and t."""
    points = surface.positions(np.mod(s, 1.0), t)
    there, here = (
        lengths(np.diff(p.reshape(-1, ALONG + 1, 3), axis=1).reshape(-1, 3))
        for p in (stock.closest_points(points), points)
    )
    return np.minimum(there, STRETCHED * here).reshape(-1, ALONG).sum(axis=1)
