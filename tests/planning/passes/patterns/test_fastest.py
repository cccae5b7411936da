"""The fastest pattern of passes, by the turning speed of the machine."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.planning.patterns import ISO_PARAMETRIC, RETRACT, STEP_OVER, curve_minutes, pattern_curves
from bonecam.planning.spacing import curves_of
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter


@pytest.mark.parametrize("degrees_per_second", [120.0, 1e5])
def test_no_pattern_that_keeps_the_scallop_takes_less_time_than_the_fastest(
    pebble: Callable[..., TSpline], roughing_cutter: Cutter, degrees_per_second: float
) -> None:
    surface, speed = pebble(), np.radians(degrees_per_second) * 60

    def minutes(pattern: str) -> float:
        curves = pattern_curves(surface, pattern, roughing_cutter, speed)
        return curve_minutes(surface, curves, roughing_cutter, speed)

    assert minutes("fastest") == min(minutes(pattern) for pattern in (*ISO_PARAMETRIC, "iso-scallop"))


def test_curves_that_begin_far_from_the_end_of_the_last_cost_retracts(
    pebble: Callable[..., TSpline], roughing_cutter: Cutter
) -> None:
    def minutes(apart: float) -> float:
        return curve_minutes(
            pebble(), curves_of([np.array([[s, 0.3], [s, 0.7]]) for s in (0.0, apart)]), roughing_cutter, np.inf
        )

    assert minutes(0.5) - minutes(0.01) == pytest.approx(RETRACT - STEP_OVER, rel=0.05)


def test_a_pass_round_takes_the_table_one_turn(pebble: Callable[..., TSpline], roughing_cutter: Cutter) -> None:
    very_slow = np.radians(1.0) * 60
    rings = pattern_curves(pebble(), "round", roughing_cutter)
    minutes = curve_minutes(pebble(), rings, roughing_cutter, very_slow)
    assert minutes * very_slow / (2 * np.pi) == pytest.approx(len(rings.group), rel=1e-3)
    along = pattern_curves(pebble(), "along", roughing_cutter)
    assert curve_minutes(pebble(), along, roughing_cutter, very_slow) < 0.01 * minutes


def test_a_pattern_that_is_unknown_is_refused(pebble: Callable[..., TSpline], roughing_cutter: Cutter) -> None:
    with pytest.raises(ValueError, match="'swirl': on this surface give fastest, along"):
        pattern_curves(pebble(), "swirl", roughing_cutter)
