"""Curves of patterns: through their knots, at the local step, covering the surface, in turn."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.planning.patterns import CLOSED_PATTERNS, ISO_PARAMETRIC, order_curves, pattern_curves
from bonecam.planning.spacing import Curves, contact_frames, curves_of, dense_samples, line_positions, ranges, side_step
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter


def test_a_curve_passes_its_knots_smoothly() -> None:
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


def test_ranges_of_kept_places_close_short_gaps_only() -> None:
    kept = np.zeros(30, dtype=bool)
    kept[[0, 1, 5, 6, 20]] = True
    assert ranges(kept, 4.0) == [(0, 8), (19, 22)]
    assert ranges(kept, 3.0) == [(0, 3), (4, 8), (19, 22)]


@pytest.fixture(scope="module")
def lengths(pebble: Callable[..., TSpline], finishing_cutter: Cutter) -> dict[str, float]:
    """Length of each pattern's curves, and of the lines along if all went from pole to pole, mm."""

    def length(curves: Curves) -> float:
        samples = dense_samples(curves, 400)
        points = contact_frames(pebble(), samples.parameters, np.array([1.0, 0.0]))[0]
        same = samples.line[1:] == samples.line[:-1]
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1)[same].sum())

    found = {
        pattern: length(pattern_curves(pebble(), pattern, finishing_cutter))
        for pattern in ISO_PARAMETRIC + CLOSED_PATTERNS
    }
    across = line_positions(pebble(), "along", finishing_cutter.radius, finishing_cutter.scallop)
    return {**found, "pole to pole": length(curves_of([np.array([[s, 0.0], [s, 1.0]]) for s in across]))}


def test_curves_at_the_local_step_are_hardly_longer_than_area_over_step(
    lengths: dict[str, float], pebble: Callable[..., TSpline], finishing_cutter: Cutter
) -> None:
    surface = pebble()
    rng = np.random.default_rng(3)
    s, t = rng.random(4000), 0.001 + 0.998 * rng.random(4000)
    _, Ss, St = surface.evaluate(s, t, 1)
    area = np.linalg.norm(np.cross(Ss, St), axis=1)
    curvature = surface.curvature(s, t)
    mean = (curvature.k1 + curvature.k2) / 2
    step = side_step(finishing_cutter.radius, finishing_cutter.scallop, mean)
    least = surface.area / float((step * area).sum() / area.sum())
    assert lengths["spiral"] <= 1.10 * least
    assert lengths["iso-scallop"] <= 1.15 * least
    assert lengths["iso-scallop"] <= 0.75 * lengths["pole to pole"]
    assert lengths["along"] <= 0.9 * lengths["pole to pole"]
    assert lengths["published"] == lengths["pole to pole"]


@pytest.fixture(scope="module", params=["along", "round", "iso-scallop", "spiral", "bands"])
def roughing_curves(
    pebble: Callable[..., TSpline], roughing_cutter: Cutter, request: pytest.FixtureRequest
) -> tuple[str, Curves]:
    """A pattern and its curves."""
    return request.param, pattern_curves(pebble(), request.param, roughing_cutter)


@pytest.mark.parametrize("direction", ["climb", "conventional"])
def test_one_way_curves_have_the_rest_on_one_side(
    pebble: Callable[..., TSpline], roughing_curves: tuple[str, Curves], direction: str
) -> None:
    surface, (pattern, curves) = pebble(), roughing_curves
    curves = order_curves(surface, curves, direction)
    parameters, tangents = curves.at(curves.line, np.arange(float(len(curves.line))))
    _, normals, feeds = contact_frames(surface, parameters, tangents)
    towards_rest = np.cross(feeds, normals) * (1 if direction == "climb" else -1)
    ahead = parameters + (np.array([0.0, -1e-3]) if pattern in ("round", "spiral") else np.array([1e-3, 0.0]))
    inner = (parameters[:, 1] > 0.05) & (parameters[:, 1] < 0.95)
    steps = surface.positions(*ahead[inner].T) - surface.positions(*parameters[inner].T)
    assert ((steps * towards_rest[inner]).sum(1) > 0).all()


def test_zigzag_enters_each_curve_at_the_nearer_end(pebble: Callable[..., TSpline], finishing_cutter: Cutter) -> None:
    surface = pebble()
    curves = order_curves(surface, pattern_curves(surface, "iso-scallop", finishing_cutter), "zigzag")
    begins, ends = (surface.positions(*curves.knots[k].T) for k in (curves.first, curves.last))
    way = np.linalg.norm(begins[1:] - ends[:-1], axis=1)
    assert (way <= np.linalg.norm(ends[1:] - ends[:-1], axis=1) + 1e-9).all()
    assert (way < 2.5 * finishing_cutter.radius).mean() > 0.8


def test_an_unknown_direction_is_refused(pebble: Callable[..., TSpline], finishing_cutter: Cutter) -> None:
    curves = pattern_curves(pebble(), "along", finishing_cutter)
    with pytest.raises(ValueError, match="'up': give zigzag, climb or conventional"):
        order_curves(pebble(), curves, "up")


def test_curves_of_a_group_that_meet_at_a_pole_are_followed_side_by_side(pebble: Callable[..., TSpline]) -> None:
    """Else each would cut a slot across the pole, and the last ones cusps only."""
    count = 30
    low = [(0.06, 0.01, 0.03, 0.01)[i % 4] for i in range(count)]
    lines = [np.array([[i / count, t], [i / count, 1 - t]]) for i, t in enumerate(low)]
    ordered = order_curves(pebble(), curves_of(lines, np.zeros(count, dtype=int)), "zigzag")
    assert np.array_equal(ordered.knots[ordered.first, 0], np.arange(count) / count)
