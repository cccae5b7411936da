"""Where the iso-parametric lines of a zig-zag lie: each line at the smallest step-over found on the line
before. A surface may be closed in s or open, and its t may end at poles or at edges (`LineEnd`).

With the feed along s, the distance to the neighbouring line across the feed grows by h = sqrt(EG - F^2) /
sqrt(E) per unit of t, E, F, G being the first fundamental form (Eqs. 13-14 of Gan et al. 2014 solved for the
distance). Divided by the exact side step of the section across the feed (`scallop.py`) and integrated over t,
it counts passes. No place of a line is more than one pass from the next line. With the feed along t, s and t
are exchanged.
"""

from collections.abc import Callable
from enum import Enum

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.errors import ToolPathError
from bonecam.planning.passes.patterns.sampling import tangent_range
from bonecam.planning.passes.patterns.scallop import side_step
from bonecam.surface.tspline import TSpline

FEED_SAMPLES = 96
"""Samples of the grid along the feed."""
ACROSS_SAMPLES = 600
"""Samples of the grid across the feed, where passes are integrated."""
FULLNESS = 0.97
"""Part of the exact side step that is used: covers the integration on the sample grid."""
MIN_FULLNESS = 0.5 * FULLNESS
"""The least part of the side step that lines are evened out with."""
MAX_TURN = np.pi
"""A cell of the grid turns by no more (radians): at a crease the curvature of one point is not that of its
whole cell."""
MAX_LINES = 20000
"""More lines than this mean that they crowd without end."""
WINDOW = 16
"""Cells of the grid that are first searched for the next line."""
MIN_CLEARANCE = 0.05
"""Where 1 + curvature * radius is less, the ball hardly fits: the contact will be lifted, and the section
counts as flat."""


class LineEnd(Enum):
    """Where the parameter across the feed begins or ends, and which lines lie there.

    POLE: half a side step away, so that the pole itself is cut. EDGE: on the edge. SEAM: at its beginning, which is
    its end.
    """

    POLE = "pole"
    EDGE = "edge"
    SEAM = "seam"


def line_positions(surface: TSpline, pattern: str, radius: float, scallop: float) -> Float[ndarray, " k"]:
    """Increasing t of the lines that run in s (`round`), or s of the lines that run in t (`along`).

    ValueError for another pattern.
    """
    if pattern not in ("round", "along"):
        raise ValueError(f"pattern {pattern!r}: give round or along, such as fastest_pattern(...)")
    across, passes = _count_passes(surface, pattern, radius, scallop)
    ends = _line_ends(surface, pattern)
    return _even_out(lambda step: _lines(across, passes, step, ends))


def needed_ranges(
    surface: TSpline, across: Float[ndarray, " k"], radius: float, scallop: float
) -> Float[ndarray, "k 2"]:
    """From which t to which each line s = `across` is needed: near poles, where lines crowd, every second, fourth, ...
    one is enough. The range of a line that is needed nowhere is NaN.

    Line i = 2^r (2 j + 1) is needed where lines i - 2^r and i + 2^r are more than a pass apart; what is left lies
    between two lines that are not, as these ranges are nested. The lines at the ends of s are needed everywhere.
    """
    s, passes = _count_passes(surface, "along", radius, scallop)
    low, high = surface.domain[1]
    t = np.linspace(low, high, len(passes))
    count = len(across)
    s_of_lines = np.r_[across, s[-1]] if surface.closed_in_s else across
    counts = np.array([np.interp(s_of_lines, s, row) for row in passes])
    ranges = np.tile([low, high], (count, 1))
    for i in range(1, count if surface.closed_in_s else count - 1):
        half = i & -i
        gap = counts[:, min(i + half, len(s_of_lines) - 1)] - counts[:, i - half]
        needed = np.flatnonzero(gap > FULLNESS)
        ranges[i] = np.nan
        if len(needed):
            ranges[i] = t[max(needed[0] - 1, 0)], t[min(needed[-1] + 1, len(t) - 1)]
    return ranges


def _line_ends(surface: TSpline, pattern: str) -> tuple[LineEnd, LineEnd]:
    """What the parameter across the feed begins and ends with."""
    if pattern == "round":
        first, last = (LineEnd.POLE if pole else LineEnd.EDGE for pole in surface.poles)
        return first, last
    sides = LineEnd.SEAM if surface.closed_in_s else LineEnd.EDGE
    return sides, sides


def _count_passes(
    surface: TSpline, pattern: str, radius: float, scallop: float
) -> tuple[Float[ndarray, " a"], Float[ndarray, "f a"]]:
    """The parameter across the feed (a,), and the passes from its start up to there at f places along the
    feed."""
    is_round = pattern == "round"
    (left, right), (low, high) = surface.domain
    s_count, t_count = (FEED_SAMPLES, ACROSS_SAMPLES) if is_round else (ACROSS_SAMPLES, FEED_SAMPLES)
    s = np.linspace(left, right, s_count)
    t = np.linspace(*tangent_range(surface), t_count)
    grid_s, grid_t = (v.ravel() for v in np.meshgrid(s, t, indexing="ij"))
    height, curvature = across_feed(surface, pattern, grid_s, grid_t)

    cell_width = (high - low) / t_count if is_round else (right - left) / s_count
    cell = np.maximum(height, np.finfo(float).eps) * cell_width
    fits = 1 + curvature * radius > MIN_CLEARANCE
    bounded = np.where(fits, np.minimum(curvature, MAX_TURN / cell), 0.0)
    rate = (height / side_step(radius, scallop, bounded)).reshape(s_count, t_count)

    across = np.linspace(low, high, t_count) if is_round else s
    if not is_round:
        rate = rate.T
    passes = np.cumsum((rate[:, 1:] + rate[:, :-1]) / 2 * np.diff(across), axis=1)
    return across, np.column_stack([np.zeros(len(passes)), passes])


def across_feed(
    surface: TSpline, pattern: str, s: Float[ndarray, " n"], t: Float[ndarray, " n"]
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Distance across the feed per unit of the parameter across it (mm), and the normal curvature of the
    section across the feed (1/mm, > 0: convex); both 0 where the surface has no tangent plane.
    """
    is_round = pattern == "round"
    _, Ss, St, Sss, Sst, Stt = surface.evaluate(s, t, 2)
    Sf, Sa, Sff, Saa = (Ss, St, Sss, Stt) if is_round else (St, Ss, Stt, Sss)
    E, F = dots(Sf, Sf), dots(Sf, Sa)
    normal = np.cross(Sf, Sa) if is_round else np.cross(Sa, Sf)
    area = np.linalg.norm(normal, axis=1)
    inverse = np.divide(1.0, area, out=np.full(len(area), np.nan), where=area > 0)
    e, f, g = (dots(second, normal) * inverse for second in (Sff, Sst, Saa))
    with np.errstate(divide="ignore", invalid="ignore"):
        height = area / np.sqrt(E)
        shear = -F / E
        curvature = -(e * shear**2 + 2 * f * shear + g) / height**2
    degenerate = ~np.isfinite(curvature)
    return np.where(degenerate, 0.0, height), np.where(degenerate, 0.0, curvature)


def _lines(
    across: Float[ndarray, " a"], passes: Float[ndarray, "f a"], step: float, ends: tuple[LineEnd, LineEnd]
) -> Float[ndarray, " k"]:
    """Lines by whole steps from the first end to the last, as each end asks for."""
    first, last = ends
    at_pole = first is LineEnd.POLE
    lines = [] if at_pole else [float(across[0])]
    ahead = step / 2 if at_pole else step
    spare = step / 2 if last is LineEnd.POLE else step
    cell = 1
    here = passes[:, 0]
    while (passes[:, -1] - here).max() > spare or not lines:
        cell, place, here = _next_line(across, passes, cell, here, ahead)
        lines.append(place)

        # ToolPathError where the last line did not move on, or there are too many
        if len(lines) > MAX_LINES or (len(lines) > 1 and not lines[-1] > lines[-2]):
            raise ToolPathError(
                f"passes crowd without end at parameter {lines[-1]:.6f}: change path.pattern, "
                "or raise surface.tolerance",
                parameter=lines[-1],
            )

        ahead = step
    if last is LineEnd.EDGE and lines[-1] < across[-1]:
        lines.append(float(across[-1]))
    return np.array(lines)


def _next_line(
    across: Float[ndarray, " a"], passes: Float[ndarray, "f a"], start: int, here: Float[ndarray, " f"], step: float
) -> tuple[int, float, Float[ndarray, " f"]]:
    """The cell (from `start` on) and the parameter at which the pass count has grown by `step` since `here`
    at one place along the feed and nowhere by more, and the counts there."""
    last = len(across) - 1
    window = WINDOW
    while start + window < last and (passes[:, start + window] - here).max() < step:
        window *= 2
    # the search begins one cell before `start`: the line before may lie in it
    moved = (passes[:, start - 1 : start + window + 1] - here[:, None]).max(axis=0)
    index = int(np.clip(np.searchsorted(moved, step), 1, len(moved) - 1))
    ratio = np.clip((step - moved[index - 1]) / (moved[index] - moved[index - 1]), 0.0, 1.0)

    cell = index + start - 1
    place = float(across[cell - 1] + ratio * (across[cell] - across[cell - 1]))
    counts = passes[:, cell - 1] + ratio * (passes[:, cell] - passes[:, cell - 1])
    return cell, place, counts


def _even_out(lines_of: Callable[[float], Float[ndarray, " k"]]) -> Float[ndarray, " k"]:
    """The lines of the smallest step that needs no more of them than the full step does."""
    low = MIN_FULLNESS
    high = FULLNESS
    best = lines_of(high)
    for _ in range(6):
        middle = (low + high) / 2
        lines = lines_of(middle)
        if len(lines) <= len(best):
            best = lines
            high = middle
        else:
            low = middle
    return best
