"""Bar and collet that a job leaves open, and the columns that they make."""

import pytest

from bonecam.errors import JobError
from bonecam.job import HoldingJob
from bonecam.machine.bodies import Table
from bonecam.workholding.clamping import STUB_CLEARANCE, clamping_of, holding_columns
from bonecam.workholding.post import Column, Post, collet_for, next_bar, settled_stub

NOTHING = HoldingJob(diameter=0.0)


@pytest.mark.parametrize(("wide", "bar"), [(12.53, 13.0), (13.0, 13.0), (20.1, 22.0), (41.0, 45.0)])
def test_the_bar_is_the_next_one_to_be_had(wide: float, bar: float) -> None:
    assert next_bar(wide) == bar


@pytest.mark.parametrize(("bar", "nut"), [(13.0, 28.0), (14.0, 35.0), (26.0, 63.0), (30.0, 90.0)])
def test_the_collet_is_the_slimmest_that_holds_the_bar(bar: float, nut: float) -> None:
    assert collet_for(bar) == nut


def test_a_holding_that_names_nothing_gets_riser_collet_and_stub() -> None:
    found = settled_stub(NOTHING, 12.53)
    columns = holding_columns(found)
    assert columns == {
        "riser": Column(30.0, 50.0),
        "chuck": Column(14.0, 100.0, 50.0),
        "stub": Column(6.5, 115.0, 100.0),
    }
    assert found.support_height == 115.0
    wide = settled_stub(NOTHING, 30.0)
    assert wide.riser_diameter == wide.chuck_diameter == 90.0


def test_a_job_that_names_its_post_stands_on_the_table_as_before() -> None:
    for stated in (HoldingJob(diameter=4.0), HoldingJob(length=60.0), HoldingJob(diameter=0.0, length=60.0)):
        assert settled_stub(stated, 12.0) == stated
        assert not holding_columns(stated)


def test_cutter_and_shank_come_nearer_to_the_stub_than_the_holder() -> None:
    clamping = clamping_of(settled_stub(NOTHING, 12.53), Table())
    assert clamping.stub == Column(6.5, 115.0, 100.0)
    assert clamping.stub not in clamping.columns
    for section in ("cutter", "neck", "shank"):
        assert clamping.kept_columns(section)[-1] == clamping.stub.grown(STUB_CLEARANCE)
    assert clamping.kept_columns("holder")[-1] == clamping.stub.grown(5.0)
    assert clamping.kept_columns("cutter", air=2.0)[-1] == clamping.stub.grown(2.0)
    assert clamping.kept_columns("cutter")[:-1] == tuple(each.grown(5.0) for each in clamping.columns)


def test_post_and_stub_are_of_the_material_above_the_chuck() -> None:
    clamping = clamping_of(settled_stub(NOTHING, 12.53), Table())
    assert clamping.carried(Post(3.0, 121.0)) == (Column(3.0, 121.0, 100.0), clamping.stub)


@pytest.mark.parametrize(
    ("holding", "said"),
    [
        (HoldingJob(diameter=4.0, stub_length=15.0, stub_diameter=10.0), "stub_diameter = 10.*12.53 mm wide"),
        (
            HoldingJob(diameter=4.0, stub_length=15.0, chuck_diameter=12.0, chuck_height=50.0),
            "chuck_diameter = 12.*bar of 13 mm",
        ),
    ],
)
def test_a_bar_thinner_than_the_stock_and_a_chuck_that_cannot_hold_it_are_refused(
    holding: HoldingJob, said: str
) -> None:
    with pytest.raises(JobError, match=said):
        settled_stub(holding, 12.53)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (
            {"riser_diameter": 60.0, "riser_height": 50.0, "chuck_diameter": 63.0, "chuck_height": 100.0},
            r"chuck_diameter = 63: give at most the riser's diameter \(60 mm\)",
        ),
        (
            {"riser_diameter": 60.0, "riser_height": 50.0, "chuck_diameter": 28.0, "chuck_height": 40.0},
            "chuck_height = 40: give more than riser_height",
        ),
        ({"riser_height": 50.0}, "riser_diameter = 0: give both sizes of the riser"),
        ({"chuck_height": 50.0}, "chuck_diameter = 0: give both sizes of the chuck"),
        ({"diameter": 13.0, "stub_diameter": 13.0, "stub_length": 15.0}, "stub_diameter = 13: give more than"),
        ({"stub_diameter": 13.0}, "stub_diameter = 13: give stub_length too"),
        ({"diameter": 0.3}, "diameter = 0.3: give 0.5 mm or more, or 0"),
        (
            {"chuck_diameter": 28.0, "chuck_height": 100.0, "stub_length": 15.0, "length": 110.0},
            r"stub_length = 15: it ends at 115 mm: give less than the post's length \(110 mm\)",
        ),
        (
            {"stub_diameter": 28.0, "stub_length": 15.0, "chuck_diameter": 28.0, "chuck_height": 100.0},
            "chuck_diameter = 28: give more than the stub's diameter",
        ),
    ],
)
def test_what_cannot_stand_on_one_another_is_refused(values: dict[str, float], said: str) -> None:
    with pytest.raises(JobError, match=said):
        HoldingJob(**values)
