"""The patterns of passes by name, and which of them a machine does soonest on a level.

The time of a move is that of its way at the feed or, where that is longer, of the turn of the table: the
azimuth of the axis follows 2 pi s. So a pass round the part takes a whole turn, one along it hardly any. From curve to
curve the tool steps over, or retracts where the next one begins farther away.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import JobError
from bonecam.planning.passes.patterns.arcs import with_arcs
from bonecam.planning.passes.patterns.bands import band_curves
from bonecam.planning.passes.patterns.curves import Curves, curves_of
from bonecam.planning.passes.patterns.iso_scallop import iso_scallop_curves
from bonecam.planning.passes.patterns.order import order_curves
from bonecam.planning.passes.patterns.sampling import ball_centres, dense_samples
from bonecam.planning.passes.patterns.spacing import line_positions, needed_ranges
from bonecam.planning.passes.patterns.spiral import spiral_curves
from bonecam.planning.passes.patterns.step_metric import step_metric
from bonecam.runtime.extensions import added, added_names, run_added
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter

ISO_PARAMETRIC = ("along", "round", "published")
"""Patterns for surfaces of all kinds; `published`: whole lines s = const (Gan et al. 2014, section 4.3)."""
CLOSED = ("iso-scallop", "spiral", "bands")
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
    known = ISO_PARAMETRIC + (CLOSED if closed else ()) + added_names("patterns")
    if pattern != "fastest" and pattern not in known:
        raise ValueError(f"pattern {pattern!r}: on this surface give fastest, {', '.join(known)}")
    names = [name for name in FASTEST if name in known] if pattern == "fastest" else [pattern]
    if pattern in added_names("patterns"):
        return _added(surface, pattern, cutter)
    candidates = list(_candidates(surface, names, cutter, turn_speed))
    return min(candidates, key=lambda curves: curve_minutes(surface, curves, cutter, turn_speed))


def check_pattern(pattern: str) -> None:
    """JobError where a pattern that was added cannot be loaded."""
    if pattern in added_names("patterns"):
        added("patterns", pattern, "lines")


def _added(surface: TSpline, pattern: str, cutter: Cutter) -> Curves:
    """The curves of a pattern that was added: those of its function of surface, ball radius and scallop, each a
    polyline (k, 2) of parameters s, t. JobError where it gives none."""
    lines = added("patterns", pattern, "lines")
    with run_added("patterns", pattern):
        drawn = [np.asarray(line, dtype=float) for line in lines(surface, cutter.envelope_radius, cutter.scallop)]
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


def curve_minutes(surface: TSpline, curves: Curves, cutter: Cutter, turn_speed: float) -> float:
    """Minutes that a machine takes for the curves at least."""
    samples = dense_samples(curves, MOVES)
    centres = ball_centres(surface, samples, cutter.envelope_radius)
    same = samples.line[1:] == samples.line[:-1]
    ways = np.linalg.norm(np.diff(centres, axis=0), axis=1)[same]
    turns = 2 * np.pi * np.abs(np.diff(samples.parameters[:, 0]))[same]
    if not surface.closed_in_s:
        turns = np.zeros_like(turns)
    cuts = np.maximum(ways / cutter.feed, turns / turn_speed).sum()

    # Minutes from curve to curve, for a ball of `radius`
    curves = order_curves(surface, curves, "zigzag")
    starts, ends = (surface.positions(*curves.knots[index].T) for index in (curves.first, curves.last))
    near = np.linalg.norm(starts[1:] - ends[:-1], axis=1) <= NEAR_RADII * cutter.envelope_radius
    return float(cuts + float(np.where(near, STEP_OVER, RETRACT).sum()))


def _candidates(surface: TSpline, names: Sequence[str], cutter: Cutter, turn_speed: float) -> Iterator[Curves]:
    """Every way to lay the patterns of these names."""
    radius, scallop = cutter.envelope_radius, cutter.scallop
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
