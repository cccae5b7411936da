"""Curves of patterns: through their knots, at the local step, covering the surface, in turn.

Arcs through what a pattern leaves too high: cusps by the balls that cut them.

The fastest pattern of passes, by the turning speed of the machine.

Lines on surfaces with edges: on the edges, no wider apart than the scallop allows, contacts on the surface.

The ring round the post, against the post itself.
"""

import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree
from small_parts import FINISHING_CUTTER, HOLDING, ROUGHING_CUTTER, mesh_of, pebble, revolved

from bonecam.arrays import dots
from bonecam.planning.patterns import (
    CLOSED_PATTERNS,
    ISO_PARAMETRIC,
    LONGEST,
    OUTSIDE,
    RETRACT,
    STEP_OVER,
    curve_minutes,
    iso_parametric_curves,
    order_curves,
    pattern_curves,
    post_rings,
    spiral_curves,
)
from bonecam.planning.spacing import (
    ROUND,
    Curves,
    ball_centres,
    contact_frames,
    curves_of,
    dense_samples,
    line_positions,
    ranges,
    sample_lines,
    side_step,
    step_metric,
    with_arcs,
)
from bonecam.surface import TSpline, skin
from bonecam.workholding import Post, post_below


def test_a_curve_passes_its_knots_smoothly():
    x = np.linspace(0, 1, 30)
    curves = curves_of([np.column_stack([x, x**2]), np.array([[0.0, 0.0], [1.0, 3.0]])])
    at_knots, _ = curves.at(curves.line, np.arange(32.0))
    assert np.allclose(at_knots, curves.knots)
    f = np.linspace(2.0, 25.0, 500)
    between, tangents = curves.at(np.zeros(500, dtype=int), f)
    assert np.abs(between[:, 1] - between[:, 0] ** 2).max() < 1e-12, "a parabola is met exactly"
    steps = np.diff(between, axis=0) / np.diff(f)[:, None]
    assert np.abs(steps - (tangents[1:] + tangents[:-1]) / 2).max() < 1e-4
    straight, _ = curves.at(np.ones(3, dtype=int), 30 + np.array([0.0, 0.3, 1.0]))
    assert np.allclose(straight, [[0, 0], [0.3, 0.9], [1, 3]])


def test_ranges_of_kept_places_close_short_gaps_only():
    kept = np.zeros(30, dtype=bool)
    kept[[0, 1, 5, 6, 20]] = True
    assert ranges(kept, 4.0) == [(0, 8), (19, 22)]
    assert ranges(kept, 3.0) == [(0, 3), (4, 8), (19, 22)]


@pytest.fixture(scope="module")
def lengths():
    """Length of each pattern's curves, and of the lines along if all went from pole to pole, mm."""

    def length(curves):
        samples = dense_samples(curves, 400)
        points = contact_frames(pebble(), samples.parameters, np.array([1.0, 0.0]))[0]
        same = samples.line[1:] == samples.line[:-1]
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1)[same].sum())

    found = {
        pattern: length(pattern_curves(pebble(), pattern, FINISHING_CUTTER))
        for pattern in ISO_PARAMETRIC + CLOSED_PATTERNS
    }
    across = line_positions(pebble(), "along", FINISHING_CUTTER.radius, FINISHING_CUTTER.scallop)
    return {**found, "pole to pole": length(curves_of([np.array([[s, 0.0], [s, 1.0]]) for s in across]))}


def test_curves_at_the_local_step_are_hardly_longer_than_area_over_step(lengths):
    surface = pebble()
    rng = np.random.default_rng(3)
    s, t = rng.random(4000), 0.001 + 0.998 * rng.random(4000)
    _, Ss, St = surface.evaluate(s, t, 1)
    area = np.linalg.norm(np.cross(Ss, St), axis=1)
    curvature = surface.curvature(s, t)
    mean = (curvature.k1 + curvature.k2) / 2
    step = side_step(FINISHING_CUTTER.radius, FINISHING_CUTTER.scallop, mean)
    least = surface.area / float((step * area).sum() / area.sum())
    assert lengths["spiral"] <= 1.10 * least
    assert lengths["iso-scallop"] <= 1.15 * least
    assert lengths["iso-scallop"] <= 0.75 * lengths["pole to pole"]
    assert lengths["along"] <= 0.9 * lengths["pole to pole"]
    assert lengths["published"] == lengths["pole to pole"]


@pytest.fixture(scope="module", params=["along", "round", "iso-scallop", "spiral", "bands"])
def roughing_curves(request):
    """A pattern and its curves."""
    return request.param, pattern_curves(pebble(), request.param, ROUGHING_CUTTER)


@pytest.mark.parametrize("direction", ["climb", "conventional"])
def test_one_way_curves_have_the_rest_on_one_side(roughing_curves, direction):
    surface, (pattern, curves) = pebble(), roughing_curves
    curves = order_curves(surface, curves, direction)
    parameters, tangents = curves.at(curves.line, np.arange(float(len(curves.line))))
    _, normals, feeds = contact_frames(surface, parameters, tangents)
    towards_rest = np.cross(feeds, normals) * (1 if direction == "climb" else -1)
    ahead = parameters + (np.array([0.0, -1e-3]) if pattern in ("round", "spiral") else np.array([1e-3, 0.0]))
    inner = (parameters[:, 1] > 0.05) & (parameters[:, 1] < 0.95)
    steps = surface.positions(*ahead[inner].T) - surface.positions(*parameters[inner].T)
    assert ((steps * towards_rest[inner]).sum(1) > 0).all()


def test_zigzag_enters_each_curve_at_the_nearer_end():
    surface = pebble()
    curves = order_curves(surface, pattern_curves(surface, "iso-scallop", FINISHING_CUTTER), "zigzag")
    begins, ends = (surface.positions(*curves.knots[k].T) for k in (curves.first, curves.last))
    way = np.linalg.norm(begins[1:] - ends[:-1], axis=1)
    assert (way <= np.linalg.norm(ends[1:] - ends[:-1], axis=1) + 1e-9).all()
    assert (way < 2.5 * FINISHING_CUTTER.radius).mean() > 0.8


def test_an_unknown_direction_is_refused():
    curves = pattern_curves(pebble(), "along", FINISHING_CUTTER)
    with pytest.raises(ValueError, match="'up': give zigzag, climb or conventional"):
        order_curves(pebble(), curves, "up")


def test_curves_of_a_group_that_meet_at_a_pole_are_followed_side_by_side():
    """Else each would cut a slot across the pole, and the last ones cusps only."""
    count = 30
    low = [(0.06, 0.01, 0.03, 0.01)[i % 4] for i in range(count)]
    lines = [np.array([[i / count, t], [i / count, 1 - t]]) for i, t in enumerate(low)]
    ordered = order_curves(pebble(), curves_of(lines, np.zeros(count, dtype=int)), "zigzag")
    assert np.array_equal(ordered.knots[ordered.first, 0], np.arange(count) / count)


PLACES = 1500


def cusps(surface: TSpline, curves: Curves, radius: float) -> Float[ndarray, " n"]:
    """The height along its normal at which the first of many balls on the curves cuts above each of PLACES, mm."""
    rng = np.random.default_rng(5)
    places = np.column_stack([rng.random(PLACES), 0.01 + 0.98 * rng.random(PLACES)])
    points, normals, _ = contact_frames(surface, places, ROUND)
    fits = -surface.curvature(*places.T).k2 * radius < 0.9
    points, normals = points[fits], normals[fits]
    centres = ball_centres(surface, dense_samples(curves, 200), radius)
    found = np.full(len(points), np.inf)
    for i, near in enumerate(KDTree(centres).query_ball_point(points, radius + 0.2)):
        away = centres[near] - points[i]
        along = away @ normals[i]
        rest = radius**2 - (away**2).sum(axis=1) + along**2
        found[i] = (along - np.sqrt(rest.clip(0.0)))[rest > 0].min(initial=np.inf)
    return found


def test_arcs_cut_what_a_spiral_leaves_too_high():
    surface, radius, scallop = pebble(), ROUGHING_CUTTER.radius, ROUGHING_CUTTER.scallop
    spiral = spiral_curves(step_metric(surface, radius, 1.6 * scallop))
    assert cusps(surface, spiral, radius).max() > 1.5 * scallop
    mended = with_arcs(surface, spiral, ROUGHING_CUTTER)
    assert cusps(surface, mended, radius).max() < 1.1 * scallop


def test_curves_that_leave_nothing_too_high_get_no_arcs():
    curves = pattern_curves(pebble(), "iso-scallop", ROUGHING_CUTTER)
    assert len(with_arcs(pebble(), curves, ROUGHING_CUTTER).group) == len(curves.group)


@pytest.mark.parametrize("degrees_per_second", [120.0, 1e5])
def test_no_pattern_that_keeps_the_scallop_takes_less_time_than_the_fastest(degrees_per_second):
    surface, speed = pebble(), np.radians(degrees_per_second) * 60

    def minutes(pattern):
        curves = pattern_curves(surface, pattern, ROUGHING_CUTTER, speed)
        return curve_minutes(surface, curves, ROUGHING_CUTTER, speed)

    assert minutes("fastest") == min(minutes(pattern) for pattern in (*ISO_PARAMETRIC, "iso-scallop"))


def test_curves_that_begin_far_from_the_end_of_the_last_cost_retracts():
    def minutes(apart):
        return curve_minutes(
            pebble(), curves_of([np.array([[s, 0.3], [s, 0.7]]) for s in (0.0, apart)]), ROUGHING_CUTTER, np.inf
        )

    assert minutes(0.5) - minutes(0.01) == pytest.approx(RETRACT - STEP_OVER, rel=0.05)


def test_a_pass_round_takes_the_table_one_turn():
    very_slow = np.radians(1.0) * 60
    rings = pattern_curves(pebble(), "round", ROUGHING_CUTTER)
    minutes = curve_minutes(pebble(), rings, ROUGHING_CUTTER, very_slow)
    assert minutes * very_slow / (2 * np.pi) == pytest.approx(len(rings.group), rel=1e-3)
    along = pattern_curves(pebble(), "along", ROUGHING_CUTTER)
    assert curve_minutes(pebble(), along, ROUGHING_CUTTER, very_slow) < 0.01 * minutes


def test_a_pattern_that_is_unknown_is_refused():
    with pytest.raises(ValueError, match="'swirl': on this surface give fastest, along"):
        pattern_curves(pebble(), "swirl", ROUGHING_CUTTER)


RADIUS, SCALLOP = 2.0, 0.02


def vault(closed: bool) -> TSpline:
    """A cylinder of radius 10 and length 30, closed or open over half a turn; without poles."""
    angle = np.linspace(0, 2 * np.pi if closed else np.pi, 41)[: -1 if closed else None]
    row = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle)])
    rows = [np.column_stack([row, np.full(len(row), z)]) for z in np.linspace(0, 30, 7)]
    return skin(rows, 1e-4, closed=closed)


@pytest.mark.parametrize("pattern", ["round", "along"])
@pytest.mark.parametrize("closed", [False, True])
def test_lines_reach_every_edge_and_stop_before_a_seam(closed, pattern):
    surface = vault(closed)
    lines = line_positions(surface, pattern, RADIUS, SCALLOP)
    low, high = surface.domain[1 if pattern == "round" else 0]
    assert (np.diff(lines) > 0).all()
    assert lines[0] == low
    assert (lines[-1] == high) == (pattern == "round" or not closed)


@pytest.mark.parametrize("pattern", ["round", "along"])
def test_lines_are_as_far_apart_as_the_scallop_allows(pattern):
    surface = vault(closed=False)
    lines = line_positions(surface, pattern, RADIUS, SCALLOP)
    kappa = 0.0 if pattern == "round" else 0.1
    flat = 2 * np.sqrt(SCALLOP * (2 * RADIUS - SCALLOP))
    exact = flat / np.sqrt((1 + kappa * RADIUS) * (1 + kappa * SCALLOP))
    length = 30.0 if pattern == "round" else 10 * np.pi
    assert len(lines) == pytest.approx(1 + length / exact, abs=2)
    assert len(lines) >= 1 + length / exact


@pytest.mark.parametrize("pattern", ["round", "along"])
def test_contacts_of_an_open_surface_lie_on_it_with_chords_within_tolerance(pattern):
    surface = vault(closed=False)
    curves = iso_parametric_curves(surface, pattern, np.array([0.0, 0.4, 1.0]), RADIUS, SCALLOP)
    lines = sample_lines(surface, curves, RADIUS, 0.002, 5.0)
    points, normals, feeds = contact_frames(surface, *curves.at(lines.line, lines.x))
    assert np.abs(np.hypot(points[:, 0], points[:, 1]) - 10).max() < 1e-3
    assert np.abs((normals * feeds).sum(1)).max() < 1e-12
    same = lines.line[1:] == lines.line[:-1]
    centres = points + RADIUS * normals
    middles = ((centres[1:] + centres[:-1]) / 2)[same]
    assert np.abs(np.hypot(middles[:, 0], middles[:, 1]) - 12).max() < 0.003
    across = (1.0, 0.4, 0.0) if pattern == "round" else (0.0, 0.4, 1.0)
    for number, fixed in enumerate(across):
        own = lines.parameters[lines.line == number]
        assert (own[:, 1 if pattern == "round" else 0] == fixed).all()
        assert own[0, 0 if pattern == "round" else 1] == 0
        assert own[-1, 0 if pattern == "round" else 1] == 1


@pytest.mark.parametrize("radius", [1.0, 2.0])
def test_the_ball_stands_beside_the_post_all_round(radius):
    surface = pebble()
    post = post_below(mesh_of(surface), HOLDING)
    (ring,) = post_rings(surface, post, radius, radius + 0.1)
    assert ring is not None
    centres = ring.contacts + radius * ring.normals
    assert post.distance(centres) == pytest.approx(radius + 0.1 + OUTSIDE, abs=1e-6)
    middles = (centres[1:] + centres[:-1]) / 2
    assert post.distance(middles).min() > radius + 0.1 - 0.01
    assert ring.contacts[0] == pytest.approx(ring.contacts[-1], abs=1e-9)
    assert np.abs(dots(ring.feeds, ring.normals)).max() < 1e-12


def test_a_post_beside_the_part_has_no_ring():
    assert post_rings(pebble(), Post(1.0, 10.0), 1.0, 1.1) == []


def test_where_the_lower_lobe_is_narrower_than_the_post_the_ring_jumps_to_the_upper_one_and_is_parted():
    def lobes(share, azimuth):
        bulge = (1.4 + 0.8 * np.cos(2 * azimuth)) * np.exp(-(((share - 0.2) / 0.1) ** 2))
        return 2.6 + bulge + 4.0 * np.clip((share - 0.4) / 0.3, 0, 1) - 2.4 * np.clip((share - 0.95) / 0.05, 0, 1)

    surface = revolved(lobes, rows=24, around=24)
    rings = post_rings(surface, Post(3.6, 38.5), 1.0, 1.1)
    assert len(rings) == 4, "two parts on each lobe"
    heights = []
    for ring in rings:
        centres = ring.contacts + ring.normals
        assert Post(3.6, 38.5).distance(centres) == pytest.approx(1.1 + OUTSIDE, abs=1e-6)
        assert np.linalg.norm(np.diff(centres, axis=0), axis=1).max() <= LONGEST
        assert np.linalg.norm(ring.contacts[0] - ring.contacts[-1]) > LONGEST, "open"
        heights.append(np.ptp(centres[:, 2]))
    assert max(heights) < 3.0
