"""Time with accelerations, against closed forms."""

import numpy as np
import pytest

from bonecam.nc.posting.feeds.motion_time import _minutes

MOST = np.array([600.0, 600.0, 600.0, np.inf, np.inf])
"""mm/min^2: slow enough for round numbers."""


def joints(*places: float) -> np.ndarray:
    table = np.zeros((len(places), 5))
    table[:, 0] = places
    return table


def test_a_long_move_takes_its_feed_and_one_ramp_more() -> None:
    # 100 mm at 60 mm/min, from rest to rest: way / v + v / a
    found = _minutes(joints(0.0, 100.0), np.array([100 / 60]), MOST)
    assert found == pytest.approx([100 / 60 + 60 / 600])


def test_a_short_move_never_reaches_its_feed() -> None:
    found = _minutes(joints(0.0, 1.0), np.array([1 / 60]), MOST)
    assert found == pytest.approx([2 * np.sqrt(1 / 600)])


def test_a_straight_line_in_pieces_takes_as_long_as_in_one() -> None:
    found = _minutes(joints(*np.linspace(0, 100, 51)), np.full(50, 2 / 60), MOST)
    assert found.sum() == pytest.approx(100 / 60 + 60 / 600)


def test_an_axis_that_turns_back_comes_nearly_to_rest_there() -> None:
    found = _minutes(joints(0.0, 50.0, 0.0), np.full(2, 50 / 60), MOST)
    assert found.sum() == pytest.approx(2 * (50 / 60 + 60 / 600), rel=1e-3)


def test_without_known_accelerations_nothing_is_added() -> None:
    given = np.array([0.3, 0.2])
    assert _minutes(joints(0.0, 1.0, 5.0), given, np.full(5, np.inf)) == pytest.approx(given)
