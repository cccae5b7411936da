"""What a tailstock takes from the tool: little where its bracket stands off, and everything is refused."""

from dataclasses import replace

import numpy as np
import pytest
from typed_values import differences

from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.mesh.part import Part
from bonecam.mesh.solids import cylinder
from bonecam.nc.path_words import machine_limits
from bonecam.planning.levels import check_parting
from bonecam.planning.neck import find_standing
from bonecam.planning.post_length import blocked_share
from bonecam.progress import silent
from bonecam.report.typed import TailstockFigures, post_report
from bonecam.setup.placement import Setup, place
from bonecam.surface.files.surface_input import read_part
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import settled_bracket

LIMITS = machine_limits(read_machine("mikron-ucp600"))
COLLET = {"diameter": 5.0, "chuck_diameter": 22.0, "chuck_height": 100.0, "stub_length": 15.0}


@pytest.fixture(scope="module")
def bar() -> Part:
    """A round bar of 8 x 30 mm."""
    return read_part(cylinder(4.0, 0.0, 30.0, 0.02), Job(), silent)[0]


def standing(bar: Part, **holding: object) -> tuple[Setup, Job]:
    job = Job().with_values(holding={**COLLET, **holding})
    setup = place(bar, job)
    found = settled_bracket(job.holding, setup.part.mesh, LIMITS.bodies.table)
    return setup, replace(job, holding=found)


def test_a_bracket_that_stands_off_takes_little_but_what_is_round_the_pin(bar: Part) -> None:
    assert blocked_share(*standing(bar), LIMITS) == 0
    assert 0 < blocked_share(*standing(bar, tailstock="pin"), LIMITS) < 0.1


def test_a_bracket_in_the_way_of_everything_is_refused(bar: Part) -> None:
    """A machine that leans its tool by 40 degrees comes from above alone, where a wide arm is."""
    steep = replace(LIMITS, largest=np.radians(40.0))
    setup, job = standing(bar, tailstock="pin", tailstock_length=2.0, tailstock_arm=200.0, tailstock_reach=60.0)
    with pytest.raises(JobError, match=r"tailstock_reach = 60: arm and column stand in the way .* everywhere"):
        blocked_share(setup, job, steep)
    assert blocked_share(setup, replace(job, holding=replace(job.holding, tailstock="none")), steep) == 0


def test_a_tailstock_is_not_blamed_for_what_no_tool_reaches_without_it(bar: Part) -> None:
    """A machine whose tool only comes from straight below, where the post is."""
    setup, job = standing(bar, tailstock="pin")
    assert blocked_share(setup, job, replace(LIMITS, smallest=np.pi - 0.01, largest=np.pi)) == 0


def test_the_bracket_that_is_found_stands_over_the_part_where_it_is_cut(bar: Part) -> None:
    setup, job, _ = find_standing(*standing(bar, tailstock="neck", tailstock_diameter=4.0), LIMITS)
    column, *arm = clamping_of(job.holding, LIMITS.bodies.table).beside
    top = float(setup.part.mesh.bounds[1, 2])
    assert setup.post.pin is not None
    assert setup.post.pin.bottom == pytest.approx(top, abs=0.02)
    assert all(one.bottom == pytest.approx(top + 12.0, abs=0.02) for one in arm)
    told = post_report(setup.post, setup.part.mesh, job.holding)["tailstock"]
    assert differences(told | {"blocked_share": 0.1}, TailstockFigures) == []
    assert column.bottom == 0.0
    assert column.top == arm[0].top


def test_a_bracket_over_the_part_leaves_its_parting_groove_free(bar: Part) -> None:
    setup, job, _ = find_standing(*standing(bar, tailstock="pin", parting=True), LIMITS)
    check_parting(setup, job, LIMITS)
    with pytest.raises(JobError, match=r"parting_stand_off = 15: the groove ends at z .* is kept off"):
        check_parting(setup, job.with_values(holding={"parting_stand_off": 15.0}), LIMITS)
