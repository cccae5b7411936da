"""A part that stands on the neck that is found for it has depths of cuts that this bears."""

from pathlib import Path

import pytest

from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.machining.standing import stand_part
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
        (Job(holding=HELD), False),
        (Job(holding=HELD, levels={"depths": "found"}), True),
    ],
)
def test_depths_are_found_with_the_neck_or_where_they_are_asked_for(job: Job, found: bool) -> None:
    standing = stand_part(PHALANX, job, read_machine(job.nc.machine), StageTimes(), silent)
    assert ("depths_found" in standing.post) == found
    levels = standing.job.levels
    if found:
        assert list(levels.listed) == standing.post["depths_found"] == sorted(levels.listed)
        assert levels.listed[0] == job.levels.finishing_depth < levels.listed[-1]
        assert levels.scallop_share > 0
    else:
        assert levels == job.levels
