"""The curves of a slice: the outline that the ball's centre may come up to, and its offsets a side step apart."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.ndimage import distance_transform_edt, gaussian_filter, map_coordinates

from bonecam.arrays import unit
from bonecam.planning.layers.chart import FlatChart

Free = Callable[[Float[ndarray, " n"], Float[ndarray, " n"]], Bool[ndarray, " n"]]
"""Whether balls of a slice are free at coordinates a and b."""
SPACED = 0.3
"""The outline is found at places about so far apart, mm: on an arc of the radius of a 2 mm ball it runs 6 um off the
straight lines between them."""
OFF = 0.3
"""A curve so far from the outline is free, mm: two cells, as the outline is known from cell to cell."""
HALVINGS = 6
"""Times that the distance to the outline is halved: to a hundredth of OFF."""
STRAIGHT = 0.02
"""Offset curves deviate from their polylines by this at most, mm."""
SMOOTH = 1.0
"""The distance to the outline is smoothed over so many cells: it is known from cell to cell only."""


def offset_curves(
    chart: FlatChart, rests: Float[ndarray, "p q"], height: float, step: float, is_free: Free
) -> list[list[Float[ndarray, "_ 2"]]]:
    """Polylines (a, b) of the slice on which the centre of a ball is at `height`, the farthest from the part first
    and its outline last; `rests` are the heights at which balls come to rest on the part.

    Above the part they are the offsets of its ridge.
    """
    blocked = rests > height

    # The highest place on each line along a
    ridge = np.zeros(rests.shape, dtype=bool)
    ridge[np.argmax(rests, axis=0), np.arange(rests.shape[1])] = True

    has_outline = blocked.any()
    away = distance_transform_edt(~(blocked if has_outline else ridge)) * (chart.b[1] - chart.b[0])
    away = gaussian_filter(away, SMOOTH)
    offsets = np.arange(1, int(away.max() / step) + 1) * step
    curves = [_contours(chart, away, offset) for offset in offsets[::-1]]
    if not has_outline:
        # A straight line along the middle of the ridge
        across = np.median(chart.a[np.argmax(ridge, axis=0)])
        return [*curves, [np.column_stack([np.full(2, across), chart.b[[0, -1]]])]]
    around = [line for line in contour_lines(chart.a, chart.b, away, OFF) if len(line) > 2]
    return [*curves, [thinned(_moved_up(chart, away, _spaced(line), is_free)) for line in around]]


def _spaced(line: Float[ndarray, "n 2"]) -> Float[ndarray, "k 2"]:
    """The points of a line about SPACED apart, with its ends: what is straight here may not be on the outline."""
    along = np.r_[0.0, np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()]
    steps = np.diff(np.floor(along / SPACED), prepend=-1.0)
    steps[-1] = 1.0
    return line[steps > 0]


def _moved_up(
    chart: FlatChart, away: Float[ndarray, "p q"], line: Float[ndarray, "n 2"], is_free: Free
) -> Float[ndarray, "n 2"]:
    """The points of a line that is OFF the outline moved on to it: as near as balls are free."""
    cell = chart.b[1] - chart.b[0]
    coordinates = ((line - [chart.a[0], chart.b[0]]) / cell).T
    slopes = [map_coordinates(slope, coordinates, order=1, mode="nearest") for slope in np.gradient(away)]
    inward = -unit(np.column_stack(slopes) + np.finfo(float).tiny)
    near, far = np.zeros(len(line)), np.full(len(line), 2 * OFF)
    for _ in range(HALVINGS):
        middle = (near + far) / 2
        free = is_free(*(line + middle[:, None] * inward).T)
        near, far = np.where(free, middle, near), np.where(free, far, middle)
    return line + near[:, None] * inward


def _contours(chart: FlatChart, field: Float[ndarray, "p q"], value: float) -> list[Float[ndarray, "_ 2"]]:
    """The lines on which a field has a value, in as few straight pieces as STRAIGHT allows."""
    contours = contour_lines(chart.a, chart.b, field, value)
    return [thinned(line) for line in contours if len(line) > 2]


def contour_lines(
    a: Float[ndarray, " p"], b: Float[ndarray, " q"], field: Float[ndarray, "p q"], value: float
) -> list[Float[ndarray, "_ 2"]]:
    """The lines (a, b) on which a field over a grid has a value."""
    from contourpy import contour_generator

    return [line[:, ::-1] for line in contour_generator(b, a, field).lines(value)]


def thinned(line: Float[ndarray, "n 2"], tolerance: float = STRAIGHT) -> Float[ndarray, "k 2"]:
    """The polyline with only so many of its points that no other is farther from it than `tolerance`
    (Douglas & Peucker 1973)."""
    kept = {0, len(line) // 2, len(line) - 1}
    open_ = list(pairwise(sorted(kept)))
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        along = line[last] - line[first]
        length = max(float(np.hypot(*along)), np.finfo(float).tiny)
        beside = line[first + 1 : last] - line[first]
        off = np.abs(beside[:, 0] * along[1] - beside[:, 1] * along[0]) / length
        worst = first + 1 + int(np.argmax(off))
        if off.max() > tolerance:
            kept.add(worst)
            open_ += [(first, worst), (worst, last)]
    return line[sorted(kept)]
