"""Arcs through what the curves of a pattern leave too high: cusps are measured, not computed from steps.

Normal probes on a grid are cut by the balls that sweep the curves. Places that keep more than the scallop lie in
strips between two curves; an arc follows the ridge of each, and the probes are cut again, until none is too high.
"""

from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.ndimage import find_objects, label

from bonecam.kernels.removal.normal_probes import Capsules, ProbesByCell, cut_normal_probes, probe_cells
from bonecam.planning.passes.patterns.curves import Curves, curves_of
from bonecam.planning.passes.patterns.sampling import ROUND, ball_centres, contact_frames, sample_lines, tangent_range
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter

AROUND, ALONG = 384, 800
"""Places of the grid in s and t: 0.05 to 0.15 mm apart on bones of 30 mm, a third of a side step of 0.28 mm."""
ROUNDS = 8
"""Times that arcs are added at most."""
CHORD = 0.05
"""Chord tolerance of the curves that normal probes are cut by, as a share of the scallop."""
LONGEST = 0.5
"""Longest move of these curves, in radii of the ball."""
LONGER = 2
"""Arcs are longer than strips by so many places at each end."""
JUMP = 2
"""A ridge that moves by more places at once goes over to another strip."""
FITS = 0.9
"""A ball fits where the sharpest hollow has less than this share of its curvature; elsewhere it is lifted."""
CELL = 0.5
"""Side of the cells that normal probes are found by, mm."""
REACH = 4.0
"""Normal probes are so high before they are cut, in scallops."""
EXCESS = 1.04
"""Cusps up to this times the scallop need no arc: the other patterns keep to no less."""


def with_arcs(surface: TSpline, curves: Curves, cutter: Cutter) -> Curves:
    """The curves on a surface that is closed in s and, behind them, the arcs that are needed so that no place of the
    grid keeps more than the cutter's scallop where the ball fits."""
    low, high = surface.domain[0]
    s = np.linspace(low, high, AROUND, endpoint=False)
    t = np.linspace(*tangent_range(surface), ALONG)
    parameters = np.column_stack([each.ravel() for each in np.meshgrid(s, t, indexing="ij")])
    points, normals, _ = contact_frames(surface, parameters, ROUND)
    fits = -surface.curvature(*parameters.T).k2 * cutter.envelope_radius < FITS
    fits = fits.reshape(AROUND, ALONG)
    order, cell_starts, corner = probe_cells(points, CELL)
    normal_probes = ProbesByCell(points[order], normals[order], cell_starts, corner, CELL)
    heights = np.full(len(points), REACH * cutter.scallop)
    pieces = np.split(curves.knots, curves.first[1:])
    added = curves
    for _ in range(ROUNDS):
        heights[order] = _cut(surface, added, cutter, normal_probes, heights[order])
        grid = heights.reshape(AROUND, ALONG)
        tips = np.maximum(_tips(grid, "wrap"), _tips(grid.T, "edge").T)
        arcs = _arcs(surface, s, t, np.where(fits, tips - EXCESS * cutter.scallop, -np.inf))
        if not arcs:
            break
        added = curves_of(arcs)
        pieces += arcs
    return curves_of(pieces)


def _cut(
    surface: TSpline, curves: Curves, cutter: Cutter, normal_probes: ProbesByCell, heights: Float[ndarray, " n"]
) -> Float[ndarray, " n"]:
    """The heights of normal probes behind the balls that sweep the curves, mm."""
    radius = cutter.envelope_radius
    lines = sample_lines(surface, curves, radius, CHORD * cutter.scallop, LONGEST * radius)
    centres = ball_centres(surface, lines, radius)
    joined = lines.line[1:] == lines.line[:-1]
    starts, ends = centres[:-1][joined], centres[1:][joined]
    left = heights.copy()
    owners = np.full(len(left), -1)
    capsules = Capsules(starts, ends, np.full(len(starts), radius), np.arange(len(starts)))
    cut_normal_probes(normal_probes, REACH * cutter.scallop, capsules, left, owners, from_top=False)
    return left


def _tips(heights: Float[ndarray, "a b"], ends: Literal["wrap", "edge"]) -> Float[ndarray, "a b"]:
    """The heights, or those of the tip of the cusp between a place and the next or last one of its column where two
    flanks meet there: the lines through the two places on either side are extended."""
    padded = np.pad(heights, ((2, 2), (0, 0)), mode=ends)
    before, first, last, behind = (padded[k : len(padded) - 3 + k] for k in range(4))
    rise, fall = first - before, last - behind
    share = (last - first + fall) / np.maximum(rise + fall, np.finfo(float).tiny)
    meets = (rise > 0) & (fall > 0) & (share > 0) & (share < 1)
    tips = np.where(meets, first + share * rise, -np.inf)
    return np.maximum(heights, np.maximum(tips[:-1], tips[1:]))


def _arcs(
    surface: TSpline, s: Float[ndarray, " a"], t: Float[ndarray, " b"], excess: Float[ndarray, "a b"]
) -> list[Float[ndarray, "_ 2"]]:
    """The ridges of the strips with an `excess` above 0, along the longer one of their two sides."""
    high = excess > 0
    begin = int(np.argmin(high.any(axis=1)))  # strips go on over the seam
    high, excess = (np.roll(each, -begin, axis=0) for each in (high, excess))
    step = s[1] - s[0]
    numbers, _ = label(high, np.ones((3, 3)))
    arcs = []
    for number, (rows, columns) in enumerate(find_objects(numbers), start=1):
        strip = np.where(numbers[rows, columns] == number, excess[rows, columns], -np.inf)
        row, column = np.arange(rows.start, rows.stop), np.arange(columns.start, columns.stop)
        across, along = row[strip.argmax(axis=0)], column[strip.argmax(axis=1)]
        lengths = [np.ptp(surface.positions(s[i], t[j]), axis=0).max() for i, j in ((row, along), (across, column))]
        if lengths[0] >= lengths[1]:
            pieces = [(_longer(i), _held(j)) for i, j in _smooth(row, along)]
        else:
            pieces = [(_held(i), _longer(j)) for j, i in _smooth(column, across)]
        arcs += [np.column_stack([s[begin] + i * step, t[j.clip(0, len(t) - 1)]]) for i, j in pieces]
    return arcs


def _smooth(at: Int[ndarray, " n"], ridge: Int[ndarray, " n"]) -> list[tuple[ndarray, ndarray]]:
    """The pieces of a ridge that do not jump: from one strip to another the surface is not to be crossed."""
    jumps = np.flatnonzero(np.abs(np.diff(ridge)) > JUMP) + 1
    return list(zip(np.split(at, jumps), np.split(ridge, jumps)))


def _longer(at: Int[ndarray, " n"]) -> Int[ndarray, " m"]:
    """Places one behind the other, LONGER more at both ends."""
    return np.arange(at[0] - LONGER, at[-1] + LONGER + 1)


def _held(ridge: Int[ndarray, " n"]) -> Int[ndarray, " m"]:
    """The ridge on these places: its ends go straight on."""
    return np.pad(ridge, LONGER, mode="edge")
