"""The depths of the cuts and the fewest cuts there can be."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bonecam.errors import LevelError
from bonecam.job import LevelsJob
from bonecam.levels.schedule import Schedule, schedule_of


def test_the_papers_schedule_needs_sixteen_cuts_for_its_finger_bone() -> None:
    schedule = schedule_of(LevelsJob())
    assert [schedule.limit(k) for k in (1, 4, 5, 16)] == [0.1, 0.1, 0.5, 0.5]
    assert schedule.lower_bound(6.34) == 16


@given(st.floats(0.01, 60.0), st.lists(st.floats(0.05, 1.0), max_size=6), st.floats(0.1, 2.0))
def test_the_lower_bound_is_the_first_sum_of_depths_that_reaches(distance: float, first: list[float], beyond: float) -> None:
    schedule = Schedule(tuple(first), beyond)
    bound = schedule.lower_bound(distance)
    assert schedule.reach(bound) >= distance
    assert bound == 1 or schedule.reach(bound - 1) < distance


@pytest.mark.parametrize("depths", [((0.1, 0.0), 0.5), ((), -1.0), ((), float("nan"))])
def test_a_depth_of_nothing_is_refused(depths: tuple[tuple[float, ...], float]) -> None:
    with pytest.raises(LevelError, match="positive depth"):
        Schedule(*depths)


def test_more_cuts_than_anybody_wants_are_refused() -> None:
    with pytest.raises(LevelError, match="deeper cuts"):
        Schedule((), 0.001).lower_bound(100.0)
