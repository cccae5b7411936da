"""Time with accelerations, against closed forms and LinuxCNC."""

import numpy as np
import pytest

from bonecam.nc.posting.feeds.motion_time import _minutes
from bonecam.nc.posting.feeds.parabolic_blends import blended_minutes

MOST = np.array([600.0, 600.0, 600.0, np.inf, np.inf])
"""mm/min^2: slow enough for round numbers."""


NO_JERK = np.full(5, np.inf)
JERK = np.array([12000.0, 12000.0, 12000.0, np.inf, np.inf])
"""mm/min^3: a / j is 0.05 min, and ramps up to a^2 / j = 30 mm/min have no constant acceleration."""


def joints(*places: float) -> np.ndarray:
    table = np.zeros((len(places), 5))
    table[:, 0] = places
    return table


def test_a_long_move_takes_its_feed_and_one_ramp_more() -> None:
    # 100 mm at 60 mm/min, from rest to rest: way / v + v / a
    found = _minutes(joints(0.0, 100.0), np.array([100 / 60]), MOST, NO_JERK)
    assert found == pytest.approx([100 / 60 + 60 / 600])


def test_a_short_move_never_reaches_its_feed() -> None:
    found = _minutes(joints(0.0, 1.0), np.array([1 / 60]), MOST, NO_JERK)
    assert found == pytest.approx([2 * np.sqrt(1 / 600)])


def test_a_straight_line_in_pieces_takes_as_long_as_in_one() -> None:
    found = _minutes(joints(*np.linspace(0, 100, 51)), np.full(50, 2 / 60), MOST, NO_JERK)
    assert found.sum() == pytest.approx(100 / 60 + 60 / 600)


def test_an_axis_that_turns_back_comes_nearly_to_rest_there() -> None:
    found = _minutes(joints(0.0, 50.0, 0.0), np.full(2, 50 / 60), MOST, NO_JERK)
    assert found.sum() == pytest.approx(2 * (50 / 60 + 60 / 600), rel=1e-3)


def test_without_known_accelerations_nothing_is_added() -> None:
    given = np.array([0.3, 0.2])
    assert _minutes(joints(0.0, 1.0, 5.0), given, np.full(5, np.inf), NO_JERK) == pytest.approx(given)


def test_a_jerk_adds_the_time_in_which_an_acceleration_builds_up() -> None:
    # rest to rest at 60 mm/min: way / v + v / a + a / j
    found = _minutes(joints(0.0, 100.0), np.array([100 / 60]), MOST, JERK)
    assert found == pytest.approx([100 / 60 + 60 / 600 + 600 / 12000])


def test_a_short_move_with_jerk_reaches_neither_feed_nor_acceleration() -> None:
    # t^3 = 32 way / j
    found = _minutes(joints(0.0, 0.1), np.array([0.1 / 60]), MOST, JERK)
    assert found == pytest.approx([(32 * 0.1 / 12000) ** (1 / 3)])


@pytest.mark.parametrize("pieces", [2, 7, 50, 400])
def test_a_line_in_pieces_with_jerk_takes_about_as_long_as_in_one(pieces: int) -> None:
    ways = np.full(pieces, 100 / 60 / pieces)
    found = _minutes(joints(*np.linspace(0, 100, pieces + 1)), ways, MOST, JERK)
    assert found.sum() == pytest.approx(100 / 60 + 60 / 600 + 600 / 12000, rel=0.02)


def test_less_jerk_takes_longer_and_much_of_it_as_none() -> None:
    places = joints(*np.cumsum(np.tile([1.0, 3.0, -2.0, 5.0], 10)))
    at_feed = np.abs(np.diff(places[:, 0])) / 60
    times = [_minutes(places, at_feed, MOST, factor * JERK).sum() for factor in (0.1, 1.0, 10.0, 1e9)]
    assert times == sorted(times, reverse=True)
    assert times[-1] == pytest.approx(_minutes(places, at_feed, MOST, NO_JERK).sum(), rel=1e-3)


K = np.arange(201)
STILL = np.zeros(201)
LINUXCNC = {
    # X, Y, Z, A, C by move (mm, degrees), seconds a move, tolerance of G64 (mm), seconds that LinuxCNC took
    "smooth": ((0.5 * K, 5 * np.sin(K / 20), STILL, 20 * np.sin(K / 15), 1.5 * K), 0.03, 0.02, 20.130),
    "zigzag": ((0.5 * K, 0.1 * (K % 2), STILL, 0.8 * K, 0.4 * K), 0.04, 0.002, 25.051),
    "slow": ((1.0 * K, STILL, STILL, 0.3 * K, STILL), 0.25, 0.01, 50.052),
}
"""Timed in LinuxCNC 2.9.0~pre1 by an `integ` of its servo thread between M64 and M65, as G93 with trivkins: all axes
20 mm/s or 30 deg/s and 300 /s^2."""


@pytest.mark.parametrize("case", LINUXCNC)
def test_parabolic_blends_take_the_time_that_linuxcnc_takes(case: str) -> None:
    columns, seconds, tolerance, measured = LINUXCNC[case]
    words = np.column_stack(columns)
    speeds = np.array([20.0, 20.0, 20.0, 30.0, 30.0])
    at_feed = np.maximum(seconds, (np.abs(np.diff(words, axis=0)) / speeds).max(1)) / 60
    most = np.full(5, 300.0 * 60**2)
    found = blended_minutes(words, at_feed, most, tolerance)
    assert found.sum() * 60 == pytest.approx(measured, rel=0.01)


def test_moves_that_nothing_speeds_up_take_their_feed() -> None:
    found = blended_minutes(joints(0.0, 1.0, 1.0, 5.0), np.array([0.3, 0.0, 0.2]), MOST * np.inf, 0.01)
    assert found == pytest.approx([0.3, 0.0, 0.2])
