"""The side step between neighbouring passes of a ball that leaves a given scallop height, exact on a circular
section.

A section across the feed of curvature kappa (1/mm, > 0 where the part bulges towards the cutter) is a circle
of radius 1/kappa. The ball centres lie on the circle 1/kappa + R, the cusp between them on 1/kappa + h. The
triangle of circle centre, ball centre and cusp gives, with theta the angle between neighbouring contacts,

    sin(theta/4) = (kappa/2) sqrt( h (2R - h) / ((1 + kappa R)(1 + kappa h)) ),    side step L = theta /
    kappa,

and L = 2 sqrt(h (2R - h)) on a plane. Source: Suresh & Yang (1994) as used by Gan et al. (2014), section 4.3.
The approximation of textbooks, L = sqrt(8 h R / (1 + kappa R)), leaves more than h.

Curves on a surface: the lines of every pattern, as knots (s, t) joined by smooth interpolation.

Between two knots a curve is the cubic Hermite polynomial whose tangents are the central differences of the knots
(Catmull and Rom 1974); a curve of two knots is straight in (s, t), so iso-parametric lines are exact.

Forward step: how many contacts a line needs so that straight moves of the ball centre follow the offset
curve C = S + R n within the chord tolerance.

Contacts are first spread by the curvature k of the offset curve (a chord of length l deviates by l^2 k / 8);
then every move is measured in its middle and halved until it holds. No move is longer than MAX_STEP.

Where the iso-parametric lines of a zig-zag lie: each line at the smallest step-over found on the line
before. A surface may be closed in s or open, and its t may end at poles or at edges (`LineEnd`).

With the feed along s, the distance to the neighbouring line across the feed grows by h = sqrt(EG - F^2) /
sqrt(E) per unit of t, E, F, G being the first fundamental form (Eqs. 13-14 of Gan et al. 2014 solved for the
distance). Divided by the exact side step of the section across the feed and integrated over t,
it counts passes. No place of a line is more than one pass from the next line. With the feed along t, s and t
are exchanged.

Side steps of a ball in every direction on a surface, on a grid of parameters.

The passes of a pattern are the level curves psi(s, t) = 1/2, 3/2, ... of a function psi that counts them. Their
distance is 1 / |grad psi|, with |grad psi|^2 = (G a^2 - 2 F a b + E b^2) / (E G - F^2) for a = psi_s, b = psi_t
and the first fundamental form E, F, G; the section across them has the normal curvature in the direction of
grad psi. They leave no more than the scallop where |grad psi| L >= 1, with L the exact side step of that
section.

Arcs through what the curves of a pattern leave too high: cusps are measured, not computed from steps.

Normal probes on a grid are cut by the balls that sweep the curves. Places that keep more than the scallop lie in
strips between two curves; an arc follows the ridge of each, and the probes are cut again, until none is too high.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import find_objects, label, maximum_filter1d, uniform_filter1d

from bonecam.arrays import dots, frozen, unit
from bonecam.errors import ToolPathError
from bonecam.kernels.rays import Capsules, ProbesByCell, cut_normal_probes, probe_cells
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter

FLAT = 1e-6
"""Sections with |sin(theta/4)| below this take the limit kappa -> 0: its relative error is FLAT^2 / 6."""


def side_step(radius: float, scallop: float, curvature: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Distance along the section between contacts (mm) that leaves cusps of exactly `scallop`.

    Where the section is so sharp that one pass leaves no cusp as high, it is the whole circumference. Raises
    ToolPathError where kappa <= -1/R: the ball cannot touch there; ValueError unless 0 < scallop < radius.
    """
    # ToolPathError where a section is hollow and sharper than the ball
    if (1 + curvature * radius <= 0).any():
        worst = int(np.argmin(curvature))
        raise ToolPathError(
            f"section {worst} bends in with curvature {curvature[worst]:.4g} 1/mm: "
            f"a ball of radius {radius:g} mm gouges; "
            f"take one below {-1 / curvature[worst]:.3g} mm",
            index=worst,
            curvature=float(curvature[worst]),
        )

    if not 0 < scallop < radius:
        raise ValueError(f"scallop {scallop} must lie between 0 and the radius {radius}")
    quotient = scallop * (2 * radius - scallop) / ((1 + curvature * radius) * (1 + curvature * scallop))
    half = np.sqrt(quotient) / 2
    sine = np.clip(curvature * half, -1, 1)
    flat = np.abs(sine) < FLAT
    return np.where(flat, 4 * half, 4 * np.arcsin(sine) / np.where(flat, 1, curvature))


@dataclass(frozen=True, eq=False)
class Curves:
    """Curves in machining order: knot i (s, t) is one of curve `line[i]`, which never decreases; curve c belongs to
    `group[c]`, which never decreases either. Within a group the order is open (`patterns.py`).

    Each curve has two knots at least and runs so that what is to be cut after it lies on its right, seen from
    outside: a cutter that turns clockwise climbs. s is not wrapped at a seam. A place on a curve is told by `x`, the
    number of the knot before it plus the share of the way to the next one.
    """

    line: Int[ndarray, " k"]
    knots: Float[ndarray, "k 2"]
    group: Int[ndarray, " c"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "line", frozen(self.line, np.int64))
        object.__setattr__(self, "knots", frozen(self.knots))
        object.__setattr__(self, "group", frozen(self.group, np.int64))

    @cached_property
    def first(self) -> Int[ndarray, " c"]:
        """The first knot of each curve."""
        return np.flatnonzero(np.r_[True, self.line[1:] != self.line[:-1]])

    @cached_property
    def last(self) -> Int[ndarray, " c"]:
        """The last knot of each curve."""
        return np.flatnonzero(np.r_[self.line[1:] != self.line[:-1], True])

    @cached_property
    def tangents(self) -> Float[ndarray, "k 2"]:
        """d(s, t)/dx at each knot."""
        steps = np.diff(self.knots, axis=0)
        before, after = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
        before[self.first], after[self.last] = after[self.first], before[self.last]
        return (before + after) / 2

    def at(
        self, line: Int[ndarray, " n"], x: Float[ndarray, " n"]
    ) -> tuple[Float[ndarray, "n 2"], Float[ndarray, "n 2"]]:
        """Parameters (s, t) at the places `x` of the curves `line`, and their tangents d(s, t)/dx."""
        i = np.clip(x.astype(np.int64), self.first[line], self.last[line] - 1)
        f = (x - i)[:, None]
        a, b = self.knots[i], self.knots[i + 1]
        u, v = self.tangents[i], self.tangents[i + 1]
        # the Hermite polynomial in powers of f
        square = 3 * (b - a) - 2 * u - v
        cube = 2 * (a - b) + u + v
        return a + f * (u + f * (square + f * cube)), u + f * (2 * square + 3 * f * cube)


def curves_of(knots: Sequence[Float[ndarray, "_ 2"]], group: Int[ndarray, " c"] | None = None) -> Curves:
    """The curves through these knots, one array each; without groups their order is fixed."""
    counts = [len(each) for each in knots]
    numbers = np.arange(len(knots))
    return Curves(np.repeat(numbers, counts), np.vstack(knots), numbers if group is None else group)


def ranges(kept: Bool[ndarray, " n"], short: float) -> list[tuple[int, int]]:
    """First place and end (exclusive) of each range of kept places, wider by one place on both sides; gaps of less
    than `short` places are closed."""
    change = np.diff(np.r_[0, kept.astype(np.int64), 0])
    starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    apart = np.flatnonzero(starts[1:] - ends[:-1] >= short)
    starts, ends = starts[np.r_[0, apart + 1]], ends[np.r_[apart, len(ends) - 1]]
    return [(max(int(a) - 1, 0), min(int(b) + 1, len(kept))) for a, b in zip(starts, ends)]


DENSE_MOVES = 128
"""Moves into which each line is first divided to find its curvature."""
MIN_MOVES = 8
"""Each line has at least this many moves."""
MAX_STEP = 1.0
"""Longest cutting move, mm: half the radius of the usual roughing ball, so that flat places are followed too."""
MAX_HALVINGS = 12
"""A first move is halved no more often than this."""
SPREAD = 0.7
"""Part of the chord tolerance that contacts are first spread for, so that few moves need halving."""
ROUND = np.array([1.0, 0.0])
"""The direction (ds, dt) of lines t = const."""
POLE = 1e-5
"""At a pole the frame is taken this far (share of the domain) inside."""


@dataclass(frozen=True, eq=False)
class LineSamples:
    """Samples on curves: sample i lies at the place `x[i]` of curve `line[i]`, which never decreases; x
    increases along a curve."""

    curves: Curves
    line: Int[ndarray, " n"]
    x: Float[ndarray, " n"]

    @property
    def parameters(self) -> Float[ndarray, "n 2"]:
        """(s, t) of every sample."""
        return self.curves.at(self.line, self.x)[0]


def tangent_range(surface: TSpline) -> tuple[float, float]:
    """The least and the largest t at which tangents are taken: POLE inside the domain at a pole, else its end."""
    low, high = (float(t) for t in surface.domain[1])
    first, last = (POLE * (high - low) * pole for pole in surface.poles)
    return low + first, high - last


def contact_frames(
    surface: TSpline, parameters: Float[ndarray, "n 2"], directions: Float[ndarray, "n 2"] | ndarray
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Points, outward unit normals and unit feed directions at (s, t), with the feed along `directions` (ds, dt); at
    poles their limits."""
    t = np.clip(parameters[:, 1], *tangent_range(surface))
    points, Ss, St = surface.evaluate(parameters[:, 0], t, 1)
    along = np.broadcast_to(directions, parameters.shape)
    feeds = along[:, :1] * Ss + along[:, 1:] * St
    return points, unit(np.cross(Ss, St)), unit(feeds)


def sample_lines(
    surface: TSpline, curves: Curves, radius: float, chord_tolerance: float, max_step: float
) -> LineSamples:
    """The contacts of all curves for a ball of `radius`; a ring has its first contact again at its end."""
    # First samples, spread by the curvature of the densely sampled offset curves.
    dense = dense_samples(curves, DENSE_MOVES)
    moves = np.diff(ball_centres(surface, dense, radius), axis=0)
    same = dense.line[1:] == dense.line[:-1]
    lengths = np.where(same, np.linalg.norm(moves, axis=1), 0.0)
    directions = unit(moves)
    # a move bends by the mean of the turns at its two ends, at the end of a curve by the one turn
    turns = np.linalg.norm(np.diff(directions, axis=0), axis=1)
    inner = same[1:] & same[:-1]
    turns = np.where(inner, turns, 0.0)
    ends = np.r_[0, inner.astype(np.int64)] + np.r_[inner.astype(np.int64), 0]
    bends = (np.r_[0.0, turns] + np.r_[turns, 0.0]) / np.maximum(ends, 1)
    by_chord = np.sqrt(lengths * bends / (8 * SPREAD * chord_tolerance))
    wanted = np.r_[0.0, np.cumsum(np.where(same, np.maximum(by_chord, lengths / max_step), 0.0))]

    bounds = np.searchsorted(dense.line, np.arange(len(curves.first) + 1))
    spread: list[ndarray] = []
    for a, b in pairwise(bounds):
        counted = wanted[a:b] - wanted[a]
        steps = max(MIN_MOVES, int(np.ceil(counted[-1])))
        spread.append(np.interp(np.linspace(0, counted[-1], steps + 1), counted, dense.x[a:b]))
    line = np.repeat(np.arange(len(spread)), [len(v) for v in spread])
    lines = LineSamples(curves, line, np.concatenate(spread))
    unchecked = np.ones(len(lines.x), dtype=bool)
    for _ in range(MAX_HALVINGS):
        # The lines with each unchecked move halved that bends or reaches too far; the halves are then unchecked. A
        # move is named by its first sample.
        first = np.flatnonzero(unchecked[:-1] & (lines.line[:-1] == lines.line[1:]))
        middle = (lines.x[first] + lines.x[first + 1]) / 2
        x = np.r_[lines.x[first], lines.x[first + 1], middle]
        probes = LineSamples(lines.curves, np.tile(lines.line[first], 3), x)
        a, b, m = np.split(ball_centres(surface, probes, radius), 3)

        chord = b - a
        length = np.linalg.norm(chord, axis=1)
        ratio = np.clip(dots(m - a, chord) / np.maximum(length, np.finfo(float).tiny) ** 2, 0, 1)
        deviation = np.linalg.norm(m - a - ratio[:, None] * chord, axis=1)
        split = (deviation > chord_tolerance) | (length > max_step)

        at = first[split] + 1
        fresh = np.zeros(len(lines.x), dtype=bool)
        fresh[first[split]] = True
        line = np.insert(lines.line, at, lines.line[first[split]])
        lines = LineSamples(lines.curves, line, np.insert(lines.x, at, middle[split]))
        unchecked = np.insert(fresh, at, True)
        if not unchecked.any():
            break
    return lines


def ball_centres(surface: TSpline, samples: LineSamples, radius: float) -> Float[ndarray, "n 3"]:
    """S + R n at the samples."""
    points, normals, _ = contact_frames(surface, samples.parameters, ROUND)
    return points + radius * normals


def dense_samples(curves: Curves, moves: int) -> LineSamples:
    """Samples at equal steps of x: `moves` on each curve, or one a knot where it has more."""
    counts = np.maximum(curves.last - curves.first, moves)
    x = [np.linspace(a, b, n + 1) for a, b, n in zip(curves.first, curves.last, counts)]
    return LineSamples(curves, np.repeat(np.arange(len(counts)), counts + 1), np.concatenate(x))


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
    if pattern == "round":
        first, last = (LineEnd.POLE if pole else LineEnd.EDGE for pole in surface.poles)
    else:
        first = last = LineEnd.SEAM if surface.closed_in_s else LineEnd.EDGE

    # The lines of the smallest step that needs no more of them than the full step does
    low = MIN_FULLNESS
    high = FULLNESS
    best = _lines(across, passes, high, (first, last))
    for _ in range(6):
        middle = (low + high) / 2
        lines = _lines(across, passes, middle, (first, last))
        if len(lines) <= len(best):
            best = lines
            high = middle
        else:
            low = middle
    return best


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
    end = len(across) - 1
    here = passes[:, 0]
    while (passes[:, -1] - here).max() > spare or not lines:
        # The cell in which the pass count has grown by the step since the last line at one place along the feed and
        # nowhere by more; the search begins one cell before the last: the line before may lie in it
        window = WINDOW
        while cell + window < end and (passes[:, cell + window] - here).max() < ahead:
            window *= 2
        moved = (passes[:, cell - 1 : cell + window + 1] - here[:, None]).max(axis=0)
        index = int(np.clip(np.searchsorted(moved, ahead), 1, len(moved) - 1))
        ratio = np.clip((ahead - moved[index - 1]) / (moved[index] - moved[index - 1]), 0.0, 1.0)
        cell += index - 1
        lines.append(float(across[cell - 1] + ratio * (across[cell] - across[cell - 1])))
        here = passes[:, cell - 1] + ratio * (passes[:, cell] - passes[:, cell - 1])

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


AROUND, ALONG = 192, 400
"""Places of the grid in s and t: cells of 0.1 to 0.3 mm on bones of 30 mm."""

METRIC_FULLNESS = 0.99
"""Part of the exact side step that is used: covers what the grid does not resolve."""
BOUND_WINDOW = 5
"""Cells of the grid over which 1 / L is bounded from above."""
MOST_SHORT = 1.2
"""Shortfalls count no more: they are mended round by round."""


@dataclass(frozen=True, eq=False)
class StepMetric:
    """The first fundamental form E, F, G, its `area` sqrt(E G - F^2), and the second form e, f, g (> 0: convex) at
    the places s x t, for a ball of `radius` that may leave `scallop` (mm). s has no second place for a seam."""

    s: Float[ndarray, " a"]
    t: Float[ndarray, " b"]
    E: Float[ndarray, "a b"]
    F: Float[ndarray, "a b"]
    G: Float[ndarray, "a b"]
    area: Float[ndarray, "a b"]
    e: Float[ndarray, "a b"]
    f: Float[ndarray, "a b"]
    g: Float[ndarray, "a b"]
    radius: float
    scallop: float

    def gradient(self, a: Float[ndarray, "a b"], b: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """|grad psi| (1/mm) of a function with psi_s = a and psi_t = b."""
        return np.sqrt(self.G * a**2 - 2 * self.F * a * b + self.E * b**2) / self.area

    def coverage(self, a: Float[ndarray, "a b"], b: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """|grad psi| L of a function with psi_s = a and psi_t = b, with L the exact side step across its level
        curves: 1 where cusps are as high as the scallop, less where they are higher."""
        along_s = self.G * a - self.F * b
        along_t = self.E * b - self.F * a
        square = a * along_s + b * along_t
        bent = self.e * along_s**2 + 2 * self.f * along_s * along_t + self.g * along_t**2
        curvature = bent / (self.area**2 * square)
        gradient = np.sqrt(square) / self.area
        # a cell of the grid turns by no more than MAX_TURN
        cell = np.abs(a) * (self.s[1] - self.s[0]) + np.abs(b) * (self.t[1] - self.t[0])
        fits = 1 + curvature * self.radius > MIN_CLEARANCE
        bounded = np.where(fits, np.minimum(curvature, MAX_TURN * gradient / cell), 0.0)
        return gradient * side_step(self.radius, self.scallop, bounded.ravel()).reshape(bounded.shape)

    def rate(self, a: Float[ndarray, "a b"], coverage: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """What psi_s = a has to be for |grad psi| L = 1 where psi_s and psi_t keep their ratio: a smooth upper bound.
        `coverage` is that of the function."""
        return _bound(a / (METRIC_FULLNESS * coverage))

    def slowness(self, a: Float[ndarray, "a b"], b: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """1 / L, which |grad psi| has to be for psi_s and psi_t in the ratio of a to b: a smooth upper bound."""
        return _bound(self.gradient(a, b) / (METRIC_FULLNESS * self.coverage(a, b)))

    def shortfall(self, coverage: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """The factor, 1 to MOST_SHORT, by which |grad psi| L falls short of 1: a smooth upper bound."""
        return _bound(np.clip(1 / coverage, 1.0, MOST_SHORT))

    @property
    def flat_step(self) -> float:
        """The side step on a plane, mm."""
        return float(2 * np.sqrt(self.scallop * (2 * self.radius - self.scallop)))


def _bound(values: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
    """A smooth bound from above: the mean, over WINDOW cells, of the largest value within WINDOW cells."""
    values = uniform_filter1d(
        maximum_filter1d(values, BOUND_WINDOW, 1, mode="nearest"), BOUND_WINDOW, 1, mode="nearest"
    )
    return uniform_filter1d(maximum_filter1d(values, BOUND_WINDOW, 0, mode="wrap"), BOUND_WINDOW, 0, mode="wrap")


def step_metric(surface: TSpline, radius: float, scallop: float) -> StepMetric:
    """The side steps on a surface that is closed in s, for a ball of `radius` that leaves `scallop` (mm) at most."""
    low, high = surface.domain[0]
    s = np.linspace(low, high, AROUND, endpoint=False)
    t = np.linspace(*tangent_range(surface), ALONG)
    grid_s, grid_t = (v.ravel() for v in np.meshgrid(s, t, indexing="ij"))
    _, Ss, St, Sss, Sst, Stt = surface.evaluate(grid_s, grid_t, 2)
    normal = np.cross(Ss, St)
    area = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
    first = [dots(Ss, Ss), dots(Ss, St), dots(St, St), area]
    second = [-dots(derivative, normal) / area for derivative in (Sss, Sst, Stt)]
    E, F, G, area, e, f, g = (form.reshape(AROUND, ALONG) for form in first + second)
    return StepMetric(s, t, E=E, F=F, G=G, area=area, e=e, f=f, g=g, radius=radius, scallop=scallop)


ARCS_AROUND, ARCS_ALONG = 384, 800
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
    s = np.linspace(low, high, ARCS_AROUND, endpoint=False)
    t = np.linspace(*tangent_range(surface), ARCS_ALONG)
    parameters = np.column_stack([each.ravel() for each in np.meshgrid(s, t, indexing="ij")])
    points, normals, _ = contact_frames(surface, parameters, ROUND)
    fits = -surface.curvature(*parameters.T).k2 * cutter.radius < FITS
    fits = fits.reshape(ARCS_AROUND, ARCS_ALONG)
    order, cell_starts, corner = probe_cells(points, CELL)
    normal_probes = ProbesByCell(points[order], normals[order], cell_starts, corner, CELL)
    heights = np.full(len(points), REACH * cutter.scallop)
    pieces = np.split(curves.knots, curves.first[1:])
    added = curves
    radius = cutter.radius
    for _ in range(ROUNDS):
        # The heights of the normal probes behind the balls that sweep the curves
        lines = sample_lines(surface, added, radius, CHORD * cutter.scallop, LONGEST * radius)
        centres = ball_centres(surface, lines, radius)
        joined = lines.line[1:] == lines.line[:-1]
        starts, ends = centres[:-1][joined], centres[1:][joined]
        capsules = Capsules(starts, ends, np.full(len(starts), radius), np.arange(len(starts)))
        left = heights[order]
        owners = np.full(len(left), -1)
        cut_normal_probes(normal_probes, REACH * cutter.scallop, capsules, left, owners, from_top=False)
        heights[order] = left
        grid = heights.reshape(ARCS_AROUND, ARCS_ALONG)
        tips = np.maximum(_tips(grid, "wrap"), _tips(grid.T, "edge").T)
        arcs = _arcs(surface, s, t, np.where(fits, tips - EXCESS * cutter.scallop, -np.inf))
        if not arcs:
            break
        added = curves_of(arcs)
        pieces += arcs
    return curves_of(pieces)


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
        along_s = lengths[0] >= lengths[1]
        at, ridge = (row, along) if along_s else (column, across)
        # from one strip to another the surface is not to be crossed
        jumps = np.flatnonzero(np.abs(np.diff(ridge)) > JUMP) + 1
        for places, piece in zip(np.split(at, jumps), np.split(ridge, jumps), strict=True):
            longer = np.arange(places[0] - LONGER, places[-1] + LONGER + 1)
            held = np.pad(piece, LONGER, mode="edge")
            i, j = (longer, held) if along_s else (held, longer)
            arcs.append(np.column_stack([s[begin] + i * step, t[j.clip(0, len(t) - 1)]]))
    return arcs
