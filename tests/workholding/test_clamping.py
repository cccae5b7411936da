"""Bar and collet that a job leaves open, and the columns that they make.

What holds the free end: where pin, arm and column stand, and what of the job is told before anything is planned.
"""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.errors import JobError
from bonecam.job import HoldingJob
from bonecam.machine.bodies import Table
from bonecam.mesh.solids import cylinder
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.workholding.clamping import STUB_CLEARANCE, clamping_of, holding_columns
from bonecam.workholding.post import (
    Column,
    Post,
    collet_for,
    footprint,
    next_bar,
    pin_above,
    post_below,
    refuse_tailstock,
    settled_bracket,
    settled_height,
    settled_stub,
)

NOTHING = HoldingJob(diameter=0.0)


@pytest.mark.parametrize(("wide", "bar"), [(12.53, 13.0), (13.0, 13.0), (20.1, 22.0), (41.0, 45.0)])
def test_the_bar_is_the_next_one_to_be_had(wide, bar):
    assert next_bar(wide) == bar


@pytest.mark.parametrize(("bar", "nut"), [(13.0, 28.0), (14.0, 35.0), (26.0, 63.0), (30.0, 90.0)])
def test_the_collet_is_the_slimmest_that_holds_the_bar(bar, nut):
    assert collet_for(bar) == nut


def test_a_holding_that_names_nothing_gets_riser_collet_and_stub():
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


def test_a_job_that_names_its_post_stands_on_the_table_as_before():
    for stated in (HoldingJob(diameter=4.0), HoldingJob(length=60.0), HoldingJob(diameter=0.0, length=60.0)):
        assert settled_stub(stated, 12.0) == stated
        assert not holding_columns(stated)


def test_cutter_and_shank_come_nearer_to_the_stub_than_the_holder():
    clamping = clamping_of(settled_stub(NOTHING, 12.53), Table())
    assert clamping.stub == Column(6.5, 115.0, 100.0)
    assert clamping.stub not in clamping.columns
    for section in ("cutter", "neck", "shank"):
        assert clamping.kept_columns(section)[-1] == clamping.stub.grown(STUB_CLEARANCE)
    assert clamping.kept_columns("holder")[-1] == clamping.stub.grown(5.0)
    assert clamping.kept_columns("cutter", air=2.0)[-1] == clamping.stub.grown(2.0)
    assert clamping.kept_columns("cutter")[:-1] == tuple(each.grown(5.0) for each in clamping.columns)


def test_post_and_stub_are_of_the_material_above_the_chuck():
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
def test_a_bar_thinner_than_the_stock_and_a_chuck_that_cannot_hold_it_are_refused(holding, said):
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
def test_what_cannot_stand_on_one_another_is_refused(values, said):
    with pytest.raises(JobError, match=said):
        HoldingJob(**values)


TABLE = Table(radius=300.0)
PIN = HoldingJob(diameter=6.0, length=100.0, tailstock="pin")


def part(x: float = 4.0) -> TriangleMesh:
    """A bar of 10 x 60 mm whose axis is `x` mm off the post's, from z = 100."""
    mesh = cylinder(5.0, 100.0, 160.0, 0.01)
    return TriangleMesh(mesh.vertices + np.array([x, 0.0, 0.0]), mesh.faces)


def settled(holding: HoldingJob = PIN, bar: TriangleMesh | None = None) -> HoldingJob:
    bar = bar or part()
    found = settled_bracket(holding, bar, TABLE)
    return settled_height(found, pin_above(bar, found), bar.vertices)


def test_the_pin_stands_over_the_highest_place_and_reaches_the_arm():
    found = settled()
    pin = pin_above(part(), found)
    assert (pin.x, pin.y) == pytest.approx((4.0, 0.0), abs=0.5)
    assert (pin.bottom, pin.top) == pytest.approx((160.0, 172.0))
    assert found.tailstock_height == pytest.approx(172.0)
    assert footprint(pin, part()) == pytest.approx(0.0, abs=0.01), "it touches a flat end and is in it nowhere"


def test_on_a_slope_the_pin_goes_in_until_all_of_its_end_has_met_the_part():
    bar = part()
    shear = np.eye(4)
    shear[2, 0] = 0.2
    steep = bar.move(shear)
    found = replace(PIN, tailstock_x=4.0)
    pin = pin_above(steep, found)
    assert pin.bottom == pytest.approx(160.0 + 0.2 * (4.0 - 1.5), abs=1e-3)
    assert footprint(pin, steep) > 0


def test_arm_and_column_stand_on_the_table_where_the_job_says():
    holding = settled(replace(PIN, tailstock_azimuth_deg=90.0))
    column, *arm = clamping_of(holding, TABLE).beside
    assert column.row == pytest.approx((15.0, 172.0 + 16.0, 0.0, 0.0, 100.0))
    assert all((one.bottom, one.top) == pytest.approx((172.0, 188.0)) for one in arm)
    # a bar 16 mm wide from pin to column is in the discs
    steps = np.linspace(0, 1, 200)[:, None]
    middle = (1 - steps) * [holding.tailstock_x, 0.0] + steps * [0.0, 100.0]
    way = np.array([-100.0, -holding.tailstock_x]) / np.hypot(100.0, holding.tailstock_x)
    edges = np.vstack([middle + 7.99 * way, middle - 7.99 * way])
    points = np.column_stack([edges, np.full(len(edges), 180.0)])
    assert (np.min([one.distance(points) for one in (column, *arm)], axis=0) < 0).all()


def test_the_whole_tool_keeps_the_clearance_from_arm_and_column():
    clamping = clamping_of(settled(), TABLE)
    for section in ("cutter", "shank", "holder", "spindle"):
        grown = clamping.kept_columns(section)[-len(clamping.beside) :]
        assert grown == tuple(column.grown(clamping.clearance) for column in clamping.beside)


def test_what_holds_the_free_end_is_kept_uncut_as_the_post_is():
    post = post_below(part(), settled())
    assert post.distance(np.array([[4.0, 0.0, 165.0], [0.0, 0.0, 50.0]])).max() < 0
    assert post.alone.distance(np.array([[4.0, 0.0, 165.0]])) > 0
    assert post.lift(7.0).pin == replace(post.pin, top=post.pin.top + 7.0, bottom=post.pin.bottom + 7.0)


def test_a_column_off_the_axis_is_as_far_as_one_on_it_from_points_moved_along():
    points = np.random.default_rng(1).normal(size=(50, 3)) * 20
    on_axis, off = Column(3.0, 10.0, -5.0), Column(3.0, 10.0, -5.0, 7.0, -4.0)
    assert off.distance(points + np.array([7.0, -4.0, 0.0])) == pytest.approx(on_axis.distance(points))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"tailstock_x": 40.0}, r"tailstock_x = 40: at \(40.00, 0.00\) nothing of the part is under the pin"),
        ({"tailstock_height": 158.0}, r"tailstock_height = 158: the part reaches up to 160.00 mm there"),
        ({"tailstock_reach": 296.0}, r"tailstock_reach = 296: .* table of 600 mm at 285 mm at most"),
        ({"tailstock_reach": 15.0}, r"tailstock_reach = 15: the column stands in the stock: give \d+ mm or more"),
    ],
)
def test_a_tailstock_that_misses_enters_or_stands_beside_the_table_is_told(changes, told):
    with pytest.raises(JobError, match=told):
        settled(replace(PIN, **changes))


def test_the_height_of_the_arm_is_refused_where_that_of_the_part_is_found():
    with pytest.raises(JobError, match=r"tailstock_height = 172: .* give holding.length too, or tailstock_length"):
        settled(replace(PIN, length=0.0, tailstock_height=172.0))


def test_an_arm_in_the_stock_is_told_with_the_length_that_clears_it():
    found = settled_bracket(PIN, part(), TABLE)
    taller = cylinder(8.0, 95.0, 175.0, 0.1).vertices
    with pytest.raises(JobError, match=r"tailstock_length = 12: the arm begins at 172.00 mm, in the stock") as error:
        settled_height(found, pin_above(part(), found), taller)
    assert "give 16 mm or more" in str(error.value)
    longer = replace(found, tailstock_length=16.0)
    assert settled_height(longer, pin_above(part(), longer), taller).tailstock_height == pytest.approx(176.0)


def test_a_pin_no_thinner_than_its_arm_is_told():
    with pytest.raises(JobError, match=r"tailstock_diameter = 20: give less than the arm"):
        HoldingJob(tailstock="neck", tailstock_diameter=20.0)


def test_what_machines_a_surface_alone_refuses_a_tailstock():
    with pytest.raises(JobError, match=r"\[holding\] tailstock = 'pin'"):
        refuse_tailstock(PIN, "this")
    refuse_tailstock(HoldingJob(), "this")
