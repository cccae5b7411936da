"""A part that stands on a neck has depths of cuts that this bears, or is refused before it is planned."""

from pathlib import Path

import pytest

from bonecam.errors import BonecamError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.machining import stand_part
from bonecam.progress import silent
from bonecam.runtime.timing import StageTimes

pytestmark = pytest.mark.whole

PHALANX = Path(__file__).parents[2] / "meshes/phalanx.ply"
HELD = {
    "diameter": 6.0,
    "length": 118.0,
    "chuck_diameter": 28.0,
    "chuck_height": 100.0,
    "stub_diameter": 13.0,
    "stub_length": 15.0,
}


@pytest.mark.parametrize(
    ("job", "found"),
    [
        (Job(), True),
        (Job(levels={"finishing_levels": 2}), False),
        (Job(holding=HELD), True),
        (Job(holding=HELD, levels={"depths": "found"}), True),
    ],
)
def test_depths_are_found_where_they_are_left_open_whoever_chose_the_neck(job: Job, found: bool) -> None:
    standing = stand_part(PHALANX, job, read_machine(job.nc.machine), StageTimes(), silent)
    assert ("depths_found" in standing.post) == found
    levels = standing.job.levels
    if found:
        assert list(levels.listed) == standing.post["depths_found"] == sorted(levels.listed)
        assert levels.listed[0] == job.levels.finishing_depth < levels.listed[-1]
        assert levels.scallop_share > 0
    else:
        assert levels == job.levels


def test_a_neck_that_breaks_is_refused_with_one_that_is_found_for_a_remedy() -> None:
    thin = Job(holding=HELD | {"diameter": 2.0})
    with pytest.raises(BonecamError, match=r"the neck does not hold.*2 x 3 mm.*holding\.diameter = 0"):
        stand_part(PHALANX, thin, read_machine(thin.nc.machine), StageTimes(), silent)
