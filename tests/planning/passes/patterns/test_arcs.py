"""Arcs through what a pattern leaves too high: cusps by the balls that cut them."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.planning.patterns import pattern_curves, spiral_curves
from bonecam.planning.spacing import ROUND, Curves, ball_centres, contact_frames, dense_samples, step_metric, with_arcs
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter

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


def test_arcs_cut_what_a_spiral_leaves_too_high(pebble: Callable[..., TSpline], roughing_cutter: Cutter) -> None:
    surface, radius, scallop = pebble(), roughing_cutter.radius, roughing_cutter.scallop
    spiral = spiral_curves(step_metric(surface, radius, 1.6 * scallop))
    assert cusps(surface, spiral, radius).max() > 1.5 * scallop
    mended = with_arcs(surface, spiral, roughing_cutter)
    assert cusps(surface, mended, radius).max() < 1.1 * scallop


def test_curves_that_leave_nothing_too_high_get_no_arcs(
    pebble: Callable[..., TSpline], roughing_cutter: Cutter
) -> None:
    curves = pattern_curves(pebble(), "iso-scallop", roughing_cutter)
    assert len(with_arcs(pebble(), curves, roughing_cutter).group) == len(curves.group)
