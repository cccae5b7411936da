"""What a cut leaves to the next one."""

import math

import pytest

from bonecam.job import Job
from bonecam.planning.estimate import least_depth


def test_a_roughing_cut_leaves_what_the_next_one_takes_off_in_any_case() -> None:
    deep = Job(levels={"depths": "0.1 0.25 1", "scallop_share": 0.2})
    assert [least_depth(level, deep) for level in range(5)] == pytest.approx([0.0, 0.0, 0.03, 0.1, 0.1])
    assert [least_depth(level, Job()) for level in (0, 4, 5, 9)] == pytest.approx([0.0, 0.0, 0.03, 0.03])


def test_a_job_may_have_everything_cut() -> None:
    everywhere = {"levels": {"depths": "0.1 1", "scallop_share": 0.2}}
    assert least_depth(3, Job(**everywhere, path={"least_depth": 0.0})) == 0.0
    assert least_depth(3, Job(**everywhere, path={"pattern": "published"})) == -math.inf
