"""What holds the free end: where pin, arm and column stand, and what of the job is told before anything is planned."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.errors import JobError
from bonecam.job import HoldingJob
from bonecam.machine.bodies import Table
from bonecam.mesh.solids import cylinder
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import (
    Column,
    footprint,
    pin_above,
    post_below,
    refuse_tailstock,
    settled_bracket,
    settled_height,
)

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


def test_the_pin_stands_over_the_highest_place_and_reaches_the_arm() -> None:
    found = settled()
    pin = pin_above(part(), found)
    assert (pin.x, pin.y) == pytest.approx((4.0, 0.0), abs=0.5)
    assert (pin.bottom, pin.top) == pytest.approx((160.0, 172.0))
    assert found.tailstock_height == pytest.approx(172.0)
    assert footprint(pin, part()) == pytest.approx(0.0, abs=0.01), "it touches a flat end and is in it nowhere"


def test_on_a_slope_the_pin_goes_in_until_all_of_its_end_has_met_the_part() -> None:
    bar = part()
    shear = np.eye(4)
    shear[2, 0] = 0.2
    steep = bar.move(shear)
    found = replace(PIN, tailstock_x=4.0)
    pin = pin_above(steep, found)
    assert pin.bottom == pytest.approx(160.0 + 0.2 * (4.0 - 1.5), abs=1e-3)
    assert footprint(pin, steep) > 0


def test_arm_and_column_stand_on_the_table_where_the_job_says() -> None:
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


def test_the_whole_tool_keeps_the_clearance_from_arm_and_column() -> None:
    clamping = clamping_of(settled(), TABLE)
    for section in ("cutter", "shank", "holder", "spindle"):
        grown = clamping.kept_columns(section)[-len(clamping.beside) :]
        assert grown == tuple(column.grown(clamping.clearance) for column in clamping.beside)


def test_what_holds_the_free_end_is_kept_uncut_as_the_post_is() -> None:
    post = post_below(part(), settled())
    assert post.distance(np.array([[4.0, 0.0, 165.0], [0.0, 0.0, 50.0]])).max() < 0
    assert post.alone.distance(np.array([[4.0, 0.0, 165.0]])) > 0
    assert post.lift(7.0).pin == replace(post.pin, top=post.pin.top + 7.0, bottom=post.pin.bottom + 7.0)


def test_a_column_off_the_axis_is_as_far_as_one_on_it_from_points_moved_along() -> None:
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
def test_a_tailstock_that_misses_enters_or_stands_beside_the_table_is_told(changes: dict, told: str) -> None:
    with pytest.raises(JobError, match=told):
        settled(replace(PIN, **changes))


def test_the_height_of_the_arm_is_refused_where_that_of_the_part_is_found() -> None:
    with pytest.raises(JobError, match=r"tailstock_height = 172: .* give holding.length too, or tailstock_length"):
        settled(replace(PIN, length=0.0, tailstock_height=172.0))


def test_an_arm_in_the_stock_is_told_with_the_length_that_clears_it() -> None:
    found = settled_bracket(PIN, part(), TABLE)
    taller = cylinder(8.0, 95.0, 175.0, 0.1).vertices
    with pytest.raises(JobError, match=r"tailstock_length = 12: the arm begins at 172.00 mm, in the stock") as error:
        settled_height(found, pin_above(part(), found), taller)
    assert "give 16 mm or more" in str(error.value)
    longer = replace(found, tailstock_length=16.0)
    assert settled_height(longer, pin_above(part(), longer), taller).tailstock_height == pytest.approx(176.0)


def test_a_pin_no_thinner_than_its_arm_is_told() -> None:
    with pytest.raises(JobError, match=r"tailstock_diameter = 20: give less than the arm"):
        HoldingJob(tailstock="neck", tailstock_diameter=20.0)


def test_what_machines_a_surface_alone_refuses_a_tailstock() -> None:
    with pytest.raises(JobError, match=r"\[holding\] tailstock = 'pin'"):
        refuse_tailstock(PIN, "this")
    refuse_tailstock(HoldingJob(), "this")
