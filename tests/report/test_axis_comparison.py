"""The comparison of tool axes measures what it says: known turns, times, and collisions."""

import numpy as np
import pytest

from bonecam.machine import MachineLimits
from bonecam.report.summary import AxisChoice, AxisComparison

STEP = 0.5
TURN = np.radians(3.0)
FEED = 600.0


def comparison(axes: np.ndarray, limits: MachineLimits, passes: np.ndarray | None = None) -> AxisComparison:
    """Contacts along X, STEP apart, on a plane below the balls."""
    count = len(axes)
    balls = np.column_stack([STEP * np.arange(count), np.zeros(count), np.ones(count)])
    free = np.ones(count, dtype=bool)
    choice = AxisChoice("turning", axes, free, limits.allow(axes))
    passes = np.zeros(count, dtype=int) if passes is None else passes
    return AxisComparison(balls - [0, 0, 1.0], balls, passes, FEED, limits, (choice,))


def turning(count: int = 21, polar: float = np.radians(40.0)) -> np.ndarray:
    """Axes whose azimuth goes on by TURN from one to the next, across the seam of -pi and pi too."""
    azimuth = np.pi - 10 * TURN + TURN * np.arange(count)
    return np.column_stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.full(count, np.cos(polar))]
    )


def test_an_even_turn_has_its_rate_no_change_of_it_and_the_time_of_the_axis() -> None:
    slow = MachineLimits(np.pi / 2, turn_speed=TURN * FEED / STEP / 2)
    made = comparison(turning(), slow)
    row = made.figures(made.choices[0])
    assert row["turn_travel_deg"] == pytest.approx(60.0)
    assert row["tilt_travel_deg"] == pytest.approx(0.0, abs=1e-9)
    chord = 2 * np.degrees(np.arcsin(np.sin(np.radians(40)) * np.sin(TURN / 2)))
    assert row["turning_rms_deg_mm"] == pytest.approx(chord / STEP)
    assert row["turning_change_rms_deg_mm2"] == pytest.approx(0.0, abs=1e-9)
    assert row["turn_speed_deg_s"] == pytest.approx(np.degrees(TURN) / (60 * STEP / FEED))
    assert row["limited_share"] == 1.0
    assert row["seconds"] == pytest.approx(2 * 60 * 20 * STEP / FEED)
    assert row["feed_mean_mm_min"] == pytest.approx(FEED / 2)


def test_what_lies_between_passes_counts_nothing() -> None:
    passes = np.repeat([0, 1, 2], 7)
    axes = np.repeat(turning()[[0, 10, 20]], 7, axis=0)
    row = comparison(axes, MachineLimits(np.pi / 2), passes)
    figures = row.figures(row.choices[0])
    assert figures["turn_travel_deg"] == 0
    assert figures["seconds"] == pytest.approx(60 * 18 * STEP / FEED)


def test_axes_beyond_the_limits_are_counted() -> None:
    made = comparison(turning(), MachineLimits(np.radians(39)))
    assert made.figures(made.choices[0])["beyond_limits"] == 21


def test_the_table_has_a_column_for_each_choice_and_tells_the_feed_alone() -> None:
    made = comparison(turning(), MachineLimits(np.pi / 2))
    lines = made.table.strip().split("\n")
    assert {line.count("|") for line in lines} == {3}
    assert lines[0] == "|  | turning |"
    assert "| collide, of 21 | 0 |" in lines
    assert "| time (s; 1 by the feed alone) | 1 |" in lines
