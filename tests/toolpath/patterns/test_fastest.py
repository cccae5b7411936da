"""The fastest pattern of passes, by the turning speed of the machine."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.surface.tspline import TSpline
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.toolpath.patterns.fastest import ISO_PARAMETRIC, curve_minutes, pattern_curves


@pytest.mark.parametrize("degrees_per_second", [120.0, 1e5])
def test_no_iso_parametric_pattern_takes_less_time_than_the_fastest(
    pebble: Callable[..., TSpline], roughing_cutter: Cutter, degrees_per_second: float
) -> None:
    surface, speed = pebble(), np.radians(degrees_per_second) * 60

    def minutes(pattern: str) -> float:
        curves = pattern_curves(surface, pattern, roughing_cutter, speed)
        return curve_minutes(surface, curves, roughing_cutter, speed)

    assert minutes("fastest") == min(minutes(pattern) for pattern in ISO_PARAMETRIC)


def test_a_pass_round_takes_the_table_one_turn(
    pebble: Callable[..., TSpline], roughing_cutter: Cutter
) -> None:
    very_slow = np.radians(1.0) * 60
    rings = pattern_curves(pebble(), "round", roughing_cutter)
    minutes = curve_minutes(pebble(), rings, roughing_cutter, very_slow)
    assert minutes * very_slow / (2 * np.pi) == pytest.approx(len(rings.group), rel=1e-3)
    along = pattern_curves(pebble(), "along", roughing_cutter)
    assert curve_minutes(pebble(), along, roughing_cutter, very_slow) < 0.01 * minutes


def test_a_pattern_that_is_unknown_is_refused(
    pebble: Callable[..., TSpline], roughing_cutter: Cutter
) -> None:
    with pytest.raises(ValueError, match="'swirl': on this surface give fastest, along"):
        pattern_curves(pebble(), "swirl", roughing_cutter)
