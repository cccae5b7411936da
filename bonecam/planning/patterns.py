"""The order and the directions in which the curves of a pattern are followed.

`zigzag`: each curve is entered at the end that is nearer to where the tool left the one before; rings are run to
and fro. `climb` and `conventional`: all curves in the one direction in which a cutter that turns clockwise climbs,
or in the other. Groups are followed in turn, and within a group the nearest curve is next, or of those that are hardly
farther the one that lies beside the last.

The ring round the post: the contacts whose ball comes as near to the post as it may.

Rings t = const end wherever the post begins, so that what they leave round it changes from level to level by up
to a side step. With this ring each level leaves the same fillet.

One spiral round a closed part, from its free end to its held one, without links.

Passes are counted from the upper pole down: psi = 0 there and |grad psi| L = 1 below (`spacing.py`), a
Hamilton-Jacobi equation that is followed row by row down t. The curves psi = const are rings, each at the exact local
step from the one before; the spiral psi = s, with s counted on from turn to turn, joins them. Where psi ends sooner at
the lower pole on some sides than on others, the spiral ends in arcs.

Bands round a closed part, from its free end to its held one, each cut by its own number of lines along the part.

A section t = const needs M(t) lines, counted by |grad psi| L = 1 (`spacing.py`). The n lines of a band, the
largest M in it, share each of its sections in equal parts of M. The bands are those that are cut in the least time, by
dynamic programming over their borders.

Curves along a closed part that are not iso-parametric: each lies at the exact local step from the one
before, so that cusps are full everywhere.

Passes are counted from some meridians, the seeds, to both sides: psi = 0 on the seed and |grad psi| L = 1 beside it
(`spacing.py`), which is solved for psi_s by iteration, psi_t being that of the round before. Where slopes are steep
this does not settle: the later rounds count more passes where the round before fell short. The curves psi = 1/2,
3/2, ... end where those of the neighbouring seed begin: where the part is slender there are fewer. So each of
them is a function s(t) over one or several ranges of t.

Two curves that meet at the border between two seeds lie at most one step apart.

The patterns of passes by name, and which of them a machine does soonest on a level.

The time of a move is that of its way at the feed or, where that is longer, of the turn of the table: the
azimuth of the axis follows 2 pi s. So a pass round the part takes a whole turn, one along it hardly any. From curve to
curve the tool steps over, or retracts where the next one begins farther away.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths, unit
from bonecam.errors import JobError
from bonecam.planning.spacing import (
    ROUND,
    Curves,
    StepMetric,
    ball_centres,
    contact_frames,
    curves_of,
    dense_samples,
    line_positions,
    needed_ranges,
    ranges,
    step_metric,
    with_arcs,
)
from bonecam.plugins import added, added_names, run_added
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import Post

SIDE_STEP = 2.0
"""A curve farther away by this is preferred where it lies beside the one before, mm: 0.13 s at 900 mm/min."""
RING_GAP = 1e-6
"""A curve whose ends are nearer to each other is a ring, mm."""


def order_curves(surface: TSpline, curves: Curves, direction: str) -> Curves:
    """The curves as they are followed. ValueError for an unknown direction."""
    if direction not in ("zigzag", "climb", "conventional"):
        raise ValueError(f"direction {direction!r}: give zigzag, climb or conventional")
    starts, ends = (surface.positions(*curves.knots[index].T) for index in (curves.first, curves.last))
    if direction == "conventional":
        starts, ends = ends, starts
    both_ways = direction == "zigzag"
    group = curves.group
    is_ring = np.linalg.norm(ends - starts, axis=1) < RING_GAP
    order = [0]
    # followed from their ends to their starts
    turned = [False]
    left = np.ones(len(group), dtype=bool)
    left[0] = False
    while left.any():
        here = (starts if turned[-1] else ends)[order[-1]]
        open_ = np.flatnonzero(left & (group == group[np.argmax(left)]))
        to_start = np.linalg.norm(starts[open_] - here, axis=1)
        to_end = np.linalg.norm(ends[open_] - here, axis=1) if both_ways else np.full(len(open_), np.inf)
        away = np.minimum(to_start, to_end)
        ahead = (open_ - order[-1]) % len(group)
        nearest = int(np.argmin(np.where(away <= away.min() + SIDE_STEP, ahead, len(group))))
        chosen = int(open_[nearest])
        back = not turned[-1] if is_ring[chosen] and both_ways else bool(to_end[nearest] < to_start[nearest])
        order.append(chosen)
        turned.append(back)
        left[chosen] = False

    pieces = np.split(curves.knots, curves.first[1:])
    reverse = direction == "conventional"
    followed = [pieces[k][::-1] if back != reverse else pieces[k] for k, back in zip(order, turned)]
    return curves_of(followed, group[order])


STEP = 0.25
"""Contacts of the ring are about so far apart, mm."""
LEAST_COUNT = 48
"""Contacts of the ring at least."""
SEARCHED = 64
"""Places on each line t from the post's end on, between which the ring is bracketed."""
HALVINGS = 24
"""Halvings of the bracket: to 1e-9 of the domain."""
LONGEST = 1.0
"""Longer moves of the ball on the ring, mm, are halved, and then left out as jumps."""
REFINEMENTS = 4
"""So often: to a sixteenth."""
OUTSIDE = 1e-3
"""The ring keeps this much more than asked, mm, for the moves between its contacts."""


@dataclass(frozen=True, eq=False)
class LineContacts:
    """The contacts of one line that comes as near to an obstacle as a ball may, as those of `LineSamples`; a closed one
    has its first contact again at its end."""

    parameters: Float[ndarray, "n 2"]
    contacts: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    feeds: Float[ndarray, "n 3"]


def post_rings(surface: TSpline, post: Post, radius: float, away: float) -> list[LineContacts]:
    """The ring on which the centre of a ball of `radius` is `away` (mm) from the post, as one closed line; or its parts
    between jumps, where lines s = const leave the post's edge for another one. Nothing where some line s = const never
    comes so near, or the lower pole is not under the post."""
    count = max(int(np.ceil(2 * np.pi * (post.radius + away) / STEP)), LEAST_COUNT)
    s = np.linspace(0.0, 1.0, count + 1)
    t = _edge(surface, post, s, radius, away)
    for k in range(REFINEMENTS + 1):
        if np.isnan(t).any():
            return []
        # Lengths of the ball's moves from place to place, mm
        points, normals, _ = contact_frames(surface, np.column_stack([s, t]), ROUND)
        jumps = np.flatnonzero(lengths(np.diff(points + radius * normals, axis=0)) > LONGEST)
        if not len(jumps) or k == REFINEMENTS:
            break
        middles = (s[jumps] + s[jumps + 1]) / 2
        t = np.insert(t, jumps + 1, _edge(surface, post, middles, radius, away))
        s = np.insert(s, jumps + 1, middles)
    if not len(jumps):
        return [_line(surface, s, t, closed=True)]
    behind = np.roll(np.arange(len(s) - 1), -jumps[0] - 1)
    parts = np.split(behind, jumps[1:] - jumps[0])
    return [_line(surface, s[part], t[part], closed=False) for part in parts if len(part) > 1]


def _edge(surface: TSpline, post: Post, s: Float[ndarray, " n"], radius: float, away: float) -> Float[ndarray, " n"]:
    """Where each line s = const comes off the post first, NaN where it begins off it or never does."""

    def spare(t: ndarray) -> Float[ndarray, " n"]:
        points, normals, _ = contact_frames(surface, np.column_stack([np.resize(s, len(t)), t]), ROUND)
        return post.distance(points + radius * normals) - away - OUTSIDE

    low, high = surface.domain[1]
    ends = [contact_frames(surface, np.array([[0.0, t]]), ROUND)[0][0, 2] for t in (low, high)]
    start, end = (low, high) if ends[0] < ends[1] else (high, low)
    t = np.linspace(start, end, SEARCHED)
    clearances = spare(np.repeat(t, len(s))).reshape(SEARCHED, len(s))
    first = np.argmax(clearances > 0, axis=0)
    near, far = t[first - 1], t[first]
    for _ in range(HALVINGS):
        middle = (near + far) / 2
        free = spare(middle) > 0
        near, far = np.where(free, near, middle), np.where(free, middle, far)
    return np.where(first > 0, far, np.nan)


def _line(surface: TSpline, s: Float[ndarray, " n"], t: Float[ndarray, " n"], *, closed: bool) -> LineContacts:
    """The contacts at these places."""
    parameters = np.column_stack([s, t])
    points, normals, _ = contact_frames(surface, parameters, ROUND)
    if closed:
        along = np.roll(points[:-1], -1, axis=0) - np.roll(points[:-1], 1, axis=0)
        along = np.vstack([along, along[:1]])
    else:
        along = np.gradient(points, axis=0)
    return LineContacts(parameters, points, normals, feeds_along(along, normals))


def feeds_along(ways: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Unit feed directions: what is across the normals of ways along a line."""
    return unit(ways - dots(ways, normals)[:, None] * normals)


SPIRAL_ROUNDS = 6
"""Rounds in which the steps follow the directions of the rings, and gaps that smoothing left are closed."""
MOST_CLOSER = 2.0
"""Where smoothing leaves gaps, passes are at most so many times closer than asked."""
SMOOTHING = 0.1
"""Waves of a ring are damped as by a Gaussian of this standard deviation, mm, at each row: they cannot grow."""
STEEPEST = 0.9
"""Largest sine of the angle between a ring and the line t = const."""
SHORT_GAP = 3.0
"""A gap of the spiral that is shorter is cut through, in side steps."""


def spiral_curves(metric: StepMetric) -> Curves:
    """The turns of the spiral as one curve, and its last arcs as further ones."""
    count = len(metric.s)
    a, b = np.zeros_like(metric.E), -np.ones_like(metric.E)
    closer = np.ones_like(metric.E)
    for _ in range(SPIRAL_ROUNDS):
        passes = _count_down(metric, closer * metric.slowness(a, b))
        around = np.pad(passes, ((1, 1), (0, 0)), mode="wrap")
        a, b = (around[2:] - around[:-2]) * count / 2, np.gradient(passes, metric.t, axis=1)
        closer = np.minimum(closer * metric.shortfall(metric.coverage(a, b)), MOST_CLOSER)

    width = passes[:, 0]
    turns = np.arange(int(np.ceil(width.max() + 1)))[:, None] + np.arange(count) / count
    t = [np.interp(turns[:, k], passes[k, ::-1], metric.t[::-1]) for k in range(count)]
    s = turns.ravel()
    side = np.arange(turns.size) % count
    knots = np.column_stack([s, np.array(t).T.ravel()])
    short = SHORT_GAP * metric.flat_step / (np.sqrt(metric.E[:, 1].mean()) / count)
    return curves_of([knots[first:end] for first, end in ranges(s - 0.5 <= width[side], short)])


def _count_down(metric: StepMetric, slowness: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
    """The passes from the upper pole down to each place for |grad psi| = slowness."""
    count, rows = metric.E.shape
    waves = 2 * np.pi * np.arange(count // 2 + 1)
    cell = metric.t[1] - metric.t[0]
    passes = np.zeros((count, rows))
    for row in range(rows - 1, 0, -1):
        E, F, area = metric.E[:, row], metric.F[:, row], metric.area[:, row]
        spectrum = np.fft.rfft(passes[:, row])
        spectrum *= np.exp(-((SMOOTHING * waves / np.sqrt(E).mean()) ** 2) / 2)
        steepest = STEEPEST * np.sqrt(E) * slowness[:, row]
        a = np.clip(np.fft.irfft(1j * waves * spectrum, count), -steepest, steepest)
        b = (F * a - area * np.sqrt(E * slowness[:, row] ** 2 - a**2)) / E
        passes[:, row - 1] = np.fft.irfft(spectrum, count) - cell * np.minimum(b, 0.0)
    return passes


BAND_ROUNDS = 4
"""Rounds of the iteration for the slopes of the lines."""
BORDERS = 80
"""Ranges of t between which borders may lie."""


def band_curves(metric: StepMetric, feed: float, step_over: float, turn: float) -> Curves:
    """The lines of those bands that take the least time at `feed` (mm/min), with `step_over` minutes from line to line
    and `turn` minutes from band to band."""
    # The share of the lines of each section that lie before each s (the seam again at its end), the number of lines
    # that the section needs, and the mean length (mm) of a line at it
    a, b = np.ones_like(metric.E), np.zeros_like(metric.E)
    for _ in range(BAND_ROUNDS):
        a = metric.rate(a, metric.coverage(a, b))
        steps = (a + np.roll(a, -1, axis=0)) / 2 / len(metric.s)
        passes = np.vstack([np.zeros(len(metric.t)), np.cumsum(steps, axis=0)])
        share = passes / passes[-1]
        b = passes[-1] * np.gradient(share[:-1], metric.t, axis=1)
    count = passes[-1]
    length = (metric.area * metric.gradient(a, b)).mean(axis=0) / count * (metric.t[1] - metric.t[0])

    s = np.r_[metric.s, 1.0]
    knots: list[ndarray] = []
    for start, end in list(pairwise(_borders(count, length / feed, step_over, turn)))[::-1]:
        lines = int(np.ceil(count[start : end + 1].max()))
        wanted = (np.arange(lines) + 0.5) / lines
        s_of_lines = np.array([np.interp(wanted, column, s) for column in share[:, start : end + 1].T])
        knots += [np.column_stack([line, metric.t[start : end + 1]]) for line in s_of_lines.T]
    return curves_of(knots)


def _borders(count: Float[ndarray, " b"], minutes: Float[ndarray, " b"], step_over: float, turn: float) -> list[int]:
    """The sections at which bands of least time begin and end, from the first to the last; `minutes` takes a
    line at each section."""
    at = np.linspace(0, len(count) - 1, BORDERS + 1).astype(np.int64)
    way = np.r_[0.0, np.cumsum(minutes)]
    least = np.r_[0.0, np.full(BORDERS, np.inf)]
    before = np.zeros(BORDERS + 1, dtype=np.int64)
    for end in range(1, BORDERS + 1):
        # the number of lines of the bands that begin at each border before this one
        lines = [np.ceil(count[at[start] : at[end] + 1].max()) for start in range(end)]
        times = least[:end] + np.array(lines) * (way[at[end]] - way[at[:end]] + step_over) + turn
        before[end] = np.argmin(times)
        least[end] = times[before[end]]
    borders = [BORDERS]
    while borders[-1]:
        borders.append(int(before[borders[-1]]))
    return [int(at[k]) for k in borders[::-1]]


SCALLOP_ROUNDS = 12
"""Rounds of the iteration: cusps then exceed a scallop of 0.01 mm by 4 % at most on five bones."""
FREE_ROUNDS = 3
"""The first rounds, in which slopes of the curves are still found, are not mended."""


def iso_scallop_curves(metric: StepMetric, seeds: int) -> Curves:
    """The curves counted from `seeds` meridians, which must divide the places of the grid in s by an even number.

    Between two seeds, the group of curves runs from the one to the other.
    """
    # The two sides of each seed meridian, that of growing s first: places s, which run away from the seed and end at
    # the border to the next one, and the passes counted from it at s x t.
    cell = metric.s[1] - metric.s[0]
    count = len(metric.s)
    half = count // (2 * seeds)
    a, b = np.ones_like(metric.E), np.zeros_like(metric.E)
    closer = np.ones_like(metric.E)
    for number in range(SCALLOP_ROUNDS):
        coverage = metric.coverage(a, b)
        if number > FREE_ROUNDS:
            closer = closer * metric.shortfall(coverage)
        rate = closer * metric.rate(a, coverage)
        between = (rate + np.roll(rate, -1, axis=0)) / 2 * cell
        sides = []
        b = np.empty_like(rate)
        for seed in np.arange(seeds) * 2 * half:
            for sign in (1, -1):
                index = seed + sign * np.arange(half + 1)
                steps = between[(index[:-1] if sign > 0 else index[1:]) % count]
                passes = np.vstack([np.zeros(len(metric.t)), np.cumsum(steps, axis=0)])
                sides.append((index * cell, passes))
                b[index % count] = sign * np.gradient(passes, metric.t, axis=1)
        a = rate
    pieces: list[ndarray] = []
    group: list[int] = []
    for k in range(seeds):
        beyond = [_pieces(metric, *side) for side in (sides[2 * k], sides[(2 * k + 3) % len(sides)])]
        turn = np.array([1.0 if k == seeds - 1 else 0.0, 0.0])
        seed_pieces = beyond[0] + [turn + piece for piece in beyond[1][::-1]]
        pieces += seed_pieces
        group += [k] * len(seed_pieces)
    return curves_of(pieces, np.array(group))


def _pieces(metric: StepMetric, s: Float[ndarray, " h"], passes: Float[ndarray, "h b"]) -> list[Float[ndarray, "_ 2"]]:
    """The curves of one side from the seed on, from low to high t."""
    width = passes[-1]
    cell = float(np.sqrt(metric.G.mean())) * (metric.t[1] - metric.t[0])
    short = SHORT_GAP * metric.flat_step / cell
    curves: list[ndarray] = []
    numbers = np.arange(int(width.max()) + 1)
    s_of_curves = np.array([np.interp(numbers + 0.5, column, s) for column in passes.T])
    for number in numbers:
        knots = np.column_stack([s_of_curves[:, number], metric.t])
        curves += [knots[a:b] for a, b in ranges(width >= number, short)]
    return curves


ISO_PARAMETRIC = ("along", "round", "published")
"""Patterns for surfaces of all kinds; `published`: whole lines s = const (Gan et al. 2014, section 4.3)."""
CLOSED_PATTERNS = ("iso-scallop", "spiral", "bands")
"""Patterns for surfaces that are closed in s, with poles."""
FASTEST = ("along", "round", "iso-scallop")
"""The patterns of which the fastest is taken: spiral and bands are hardly ever sooner, and take longer to plan."""
SEEDS = (3, 4, 6)
"""Numbers of meridians from which iso-scallop curves are tried to be counted."""
MOVES = 48
"""Moves into which a curve is divided to measure it."""
STEP_OVER, RETRACT = 0.1 / 60, 0.9 / 60
"""Times from the end of one curve to the begin of the next near it, and to one farther away, minutes; as measured in
programs of a scaphoid."""
NEAR_RADII = 2.5
"""The next curve is near within so many radii of the ball."""


def pattern_curves(surface: TSpline, pattern: str, cutter: Cutter, turn_speed: float = np.inf) -> Curves:
    """The curves of a pattern, or of the `fastest` one of along, round and iso-scallop; `turn_speed` (rad/min) is that
    of the axis that changes the azimuth. ValueError for an unknown pattern, or one that needs a surface of another
    kind."""
    closed = surface.closed_in_s and all(surface.poles)
    known = ISO_PARAMETRIC + (CLOSED_PATTERNS if closed else ()) + added_names("patterns")
    if pattern != "fastest" and pattern not in known:
        raise ValueError(f"pattern {pattern!r}: on this surface give fastest, {', '.join(known)}")
    names = [name for name in FASTEST if name in known] if pattern == "fastest" else [pattern]
    if pattern in added_names("patterns"):
        # The curves of a pattern that was added: those of its function of surface, ball radius and scallop, each a
        # polyline (k, 2) of parameters s, t. JobError where it gives none.
        lines = added("patterns", pattern)
        with run_added("patterns", pattern):
            drawn = [np.asarray(line, dtype=float) for line in lines(surface, cutter.radius, cutter.scallop)]
        if not drawn or not all(line.ndim == 2 and line.shape[1] == 2 and len(line) > 1 for line in drawn):
            remedy = "give one polyline or more, each an array (k, 2) of s and t with two points or more"
            raise JobError(f"the pattern {pattern!r} that was added gives no lines: {remedy}", pattern=pattern)
        (s_low, s_high), (low, high) = surface.domain
        points = np.vstack(drawn)
        s_bounds = (-np.inf, np.inf) if surface.closed_in_s else (s_low, s_high)
        inside = (points >= [s_bounds[0], low]) & (points <= [s_bounds[1], high]) & np.isfinite(points)
        if not inside.all():
            s, t = points[~inside.all(axis=1)][0]
            what = f"the pattern {pattern!r} that was added leaves the surface at s = {s:g}, t = {t:g}"
            remedy = f"give s from {s_low:g} to {s_high:g} and t from {low:g} to {high:g}"
            raise JobError(f"{what}: {remedy}", pattern=pattern)
        return curves_of(drawn)
    candidates = list(_candidates(surface, names, cutter, turn_speed))
    return min(candidates, key=lambda curves: curve_minutes(surface, curves, cutter, turn_speed))


def curve_minutes(surface: TSpline, curves: Curves, cutter: Cutter, turn_speed: float) -> float:
    """Minutes that a machine takes for the curves at least."""
    samples = dense_samples(curves, MOVES)
    centres = ball_centres(surface, samples, cutter.radius)
    same = samples.line[1:] == samples.line[:-1]
    ways = np.linalg.norm(np.diff(centres, axis=0), axis=1)[same]
    turns = 2 * np.pi * np.abs(np.diff(samples.parameters[:, 0]))[same]
    if not surface.closed_in_s:
        turns = np.zeros_like(turns)
    cuts = np.maximum(ways / cutter.feed, turns / turn_speed).sum()

    # Minutes from curve to curve, for a ball of `radius`
    curves = order_curves(surface, curves, "zigzag")
    starts, ends = (surface.positions(*curves.knots[index].T) for index in (curves.first, curves.last))
    near = np.linalg.norm(starts[1:] - ends[:-1], axis=1) <= NEAR_RADII * cutter.radius
    return float(cuts + float(np.where(near, STEP_OVER, RETRACT).sum()))


def _candidates(surface: TSpline, names: Sequence[str], cutter: Cutter, turn_speed: float) -> Iterator[Curves]:
    """Every way to lay the patterns of these names."""
    radius, scallop = cutter.radius, cutter.scallop
    for name in ISO_PARAMETRIC:
        if name in names:
            lines = "round" if name == "round" else "along"
            across = line_positions(surface, lines, radius, scallop)
            yield iso_parametric_curves(surface, name, across, radius, scallop)
    if set(names) <= set(ISO_PARAMETRIC):
        return
    metric = step_metric(surface, radius, scallop)
    if "iso-scallop" in names:
        for seeds in SEEDS:
            yield iso_scallop_curves(metric, seeds)
    if "spiral" in names:
        yield with_arcs(surface, spiral_curves(metric), cutter)
    if "bands" in names:
        bands = band_curves(metric, cutter.feed, STEP_OVER, 2 * np.pi / turn_speed)
        yield with_arcs(surface, bands, cutter)


def iso_parametric_curves(
    surface: TSpline, pattern: str, across: Float[ndarray, " k"], radius: float, scallop: float
) -> Curves:
    """Lines t = const from the upper end down (`round`), s = const where they are needed (`along`) or whole
    (`published`), at these increasing places."""
    if pattern == "round":
        ends = surface.domain[0]
        return curves_of([np.column_stack([ends, np.full(2, t)]) for t in across[::-1]])
    if pattern == "published":
        return curves_of([np.column_stack([np.full(2, s), surface.domain[1]]) for s in across])
    ranges = needed_ranges(surface, across, radius, scallop)
    return curves_of([np.column_stack([[s, s], ends]) for s, ends in zip(across, ranges) if np.isfinite(ends).all()])
