"""The faster pattern of passes, by the turning speed of the machine and the size of the part."""

from collections.abc import Callable

import numpy as np

from bonecam.surface.tspline import TSpline
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.toolpath.patterns.fastest import fastest_pattern, pattern_minutes


def test_a_slender_part_is_cut_along_on_a_slow_table_and_round_on_a_fast_one(
    pebble: Callable[..., TSpline], roughing_cutter: Cutter
) -> None:
    slow, fast = np.radians(120.0) * 60, np.radians(1e5) * 60
    surface = pebble()
    assert fastest_pattern(surface, roughing_cutter, slow) == "along"
    lengths = {name: pattern_minutes(surface, name, roughing_cutter, np.inf) for name in ("round", "along")}
    assert fastest_pattern(surface, roughing_cutter, fast) == min(lengths, key=lambda name: lengths[name])


def test_a_pass_round_takes_the_table_one_turn(
    pebble: Callable[..., TSpline], roughing_cutter: Cutter
) -> None:
    very_slow = np.radians(1.0) * 60
    minutes = pattern_minutes(pebble(), "round", roughing_cutter, very_slow)
    turns = minutes * very_slow / (2 * np.pi)
    assert abs(turns - round(turns)) < 1e-9
    assert pattern_minutes(pebble(), "along", roughing_cutter, very_slow) < 0.01 * minutes
