"""The depths of the cuts and the fewest cuts there can be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bonecam.arrays import ROUNDING
from bonecam.errors import JobError, LevelError
from bonecam.job import Job, LevelsJob
from bonecam.setup.stock import Schedule, even_out, schedule_of


def test_the_papers_schedule_needs_sixteen_cuts_for_its_finger_bone() -> None:
    schedule = schedule_of(LevelsJob())
    assert [schedule.limit(k) for k in (1, 4, 5, 16)] == [0.1, 0.1, 0.5, 0.5]
    assert schedule.lower_bound(6.34) == 16


@given(st.floats(0.01, 60.0), st.lists(st.floats(0.05, 1.0), max_size=6), st.floats(0.1, 2.0))
def test_the_lower_bound_is_the_first_sum_of_depths_that_reaches(
    distance: float, first: list[float], beyond: float
) -> None:
    schedule = Schedule(tuple(first), beyond)
    bound = schedule.lower_bound(distance)
    assert schedule.reach(bound) >= distance - ROUNDING
    assert bound == 1 or schedule.reach(bound - 1) < distance


def test_a_sum_of_depths_that_rounding_leaves_short_reaches() -> None:
    assert Schedule((0.1,) * 10, 0.5).lower_bound(1.0) == 10
    assert Schedule((), 0.5).lower_bound(2.000000000000013) == 4
    assert Schedule((), 0.5).lower_bound(2.0001) == 5


@pytest.mark.parametrize(
    "depths",
    [((0.1, 0.0), 0.5), ((), -1.0), ((), float("nan")), ((), 1e-300), ((), float("inf")), ((float("inf"),), 0.5)],
)
def test_a_depth_of_nothing_or_without_end_is_refused(depths: tuple[tuple[float, ...], float]) -> None:
    with pytest.raises(LevelError, match="finite depth of at least"):
        Schedule(*depths)


def test_more_cuts_than_anybody_wants_are_refused() -> None:
    with pytest.raises(
        LevelError, match=r"^100\.0 mm .* more than 2000 cuts, which take 2\.0 mm: give deeper cuts"
    ) as caught:
        Schedule((), 0.001).lower_bound(100.0)
    assert caught.value.evidence["distance"] == 100.0
    with pytest.raises(LevelError, match="nan"):
        Schedule((), 0.5).lower_bound(float("nan"))


def test_a_list_of_depths_rules_and_its_last_holds_for_all_others() -> None:
    schedule = schedule_of(LevelsJob(depths="0.05, 0.1 0.4", finishing_levels=7))
    assert [schedule.limit(k) for k in (1, 2, 3, 9)] == [0.05, 0.1, 0.4, 0.4]
    assert schedule_of(LevelsJob(depths="0.3")) == Schedule((), 0.3)


def test_the_fewest_levels_are_all_at_the_roughing_depth() -> None:
    job, distance = LevelsJob(schedule="fewest"), 6.34
    assert schedule_of(job) == Schedule((), 0.5)
    assert schedule_of(job).lower_bound(distance) == 13 < schedule_of(LevelsJob()).lower_bound(distance)


def test_a_list_may_be_an_array_but_not_empty() -> None:
    assert LevelsJob(depths=np.array([0.1, 0.3])).cuts == ((0.1,), 0.3)  # type: ignore[arg-type]
    with pytest.raises(JobError, match=r"^depths = \[\]: give one at least"):
        LevelsJob(depths=[])  # type: ignore[arg-type]


def test_a_list_of_depths_and_the_fewest_cuts_are_not_both_taken() -> None:
    with pytest.raises(JobError, match=r"^depths = '0\.1 0\.5': .*schedule = 'fewest'.* leave one of them out$"):
        LevelsJob(depths="0.1 0.5", schedule="fewest")


@pytest.mark.parametrize("depths", ["deep", "0.1;0.2", "0.1 0 0.5", "0.1 -1", "nan", "0.1 inf"])
def test_a_list_that_is_none_is_refused(depths: str) -> None:
    with pytest.raises(JobError, match=r"^depths = "):
        LevelsJob(depths=depths)


@pytest.mark.parametrize(
    ("levels", "finishing"),
    [
        ({}, 4),
        ({"finishing_levels": 0}, 1),
        ({"schedule": "fewest"}, 1),
        ({"depths": "0.1 0.05 0.2 0.5"}, 2),
        ({"depths": "0.3 0.1"}, 20),
    ],
)
def test_the_finishing_cutter_machines_what_is_cut_no_deeper_than_finishing(
    levels: dict[str, object], finishing: int
) -> None:
    job = Job().with_values(levels=levels)
    kinds = [job.is_finishing(level) for level in range(20)]
    assert kinds[0]
    assert sum(kinds) == finishing


@given(st.floats(0.2, 1.0), st.floats(0.8, 1.0), st.integers(2, 30), st.floats(0.02, 0.98))
def test_evened_cuts_share_what_the_last_had_left(beyond: float, share: float, count: int, left: float) -> None:
    """`count` cuts that each gain `share` of their depth and a last one of `left` of its depth."""
    first = (0.1, 0.1)
    rest = left * beyond
    distance = sum(first) + count * share * beyond + rest
    even = even_out(Schedule(first, beyond), distance, 2 + count + 1, rest)
    assert even.beyond <= beyond
    assert distance - sum(first) - count * share * even.beyond == pytest.approx(min(even.beyond, distance))


def test_a_list_of_too_many_depths_is_refused() -> None:
    with pytest.raises(JobError, match="give at most 2000; the last holds for all others"):
        LevelsJob(depths="0.1 " * 2001)
