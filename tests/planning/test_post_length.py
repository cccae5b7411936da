"""What would shorten a post: every remedy is the length that is found with it.

How much higher a ball must be, against all slices of its tool over table and columns.

The shortest post of contacts that are reached, and of none.

What carries a surface that is machined alone, and how thick its post is.

What a tailstock takes from the tool: little where its bracket stands off, and everything is refused.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_parts import FINISHING_CUTTER
from typed_values import differences

from bonecam.arrays import unit
from bonecam.errors import JobError, OrientationError
from bonecam.job import HoldingJob, Job
from bonecam.machine import read_machine
from bonecam.machine.bodies import Frustum
from bonecam.mesh import Part
from bonecam.mesh.solids import cylinder
from bonecam.mesh.triangle_mesh import side_by_side
from bonecam.nc import machine_limits
from bonecam.planning import find_standing
from bonecam.planning.axes.lead import LEAVING, ROOM
from bonecam.planning.parting import check_parting
from bonecam.planning.post_length import (
    SLICE,
    STEEP_TILT,
    blocked_share,
    carrying_solid,
    check_reached,
    find_post_length,
    level_lifts,
    needed_lifts,
    shortest_post,
    surface_holding,
    what_would_help,
)
from bonecam.progress import silent
from bonecam.report.typed import TailstockFigures, post_report
from bonecam.setup import Setup, place
from bonecam.surface import skin
from bonecam.surface.files.surface_input import read_part
from bonecam.workholding import Clamping, clamping_of
from bonecam.workholding.post import Column, settled_bracket

PHALANX = Path(__file__).parents[2] / "meshes/phalanx.ply"
THICK = {"holder_diameter": 20.0, "holder_length": 50.0}
SLENDER = Job().with_values(
    holding={"diameter": 4.0},
    roughing={"overhang": 30.0, **THICK},
    finishing={"flute_length": 4.0, "shank_diameter": 2.0, "overhang": 25.0, **THICK},
)
"""A thin post that stands on the table, and cutters in thick holders."""
MACHINE = read_machine("mikron-ucp600")
LIMITS = machine_limits(MACHINE)


@pytest.fixture(scope="module")
def standing():
    """The phalanx on the post that is found for it, and its job."""
    unplaced, _ = read_part(PHALANX, SLENDER, silent)
    return find_post_length(place(unplaced, SLENDER), SLENDER, LIMITS)


@pytest.fixture(scope="module")
def advice(standing):
    return what_would_help(*standing, LIMITS)


@pytest.mark.plugged
def test_a_level_tool_needs_room_for_its_widest_part_over_the_table(standing):
    setup, job = standing
    rotary = replace(job, path=replace(job.path, strategy="rotary"))
    assert not len(level_lifts(setup, job, MACHINE.bodies))
    widest = max(frustum.top_diameter for frustum in MACHINE.bodies.nose) / 2
    height = setup.stock.bounds[0, 2] + level_lifts(setup, rotary, MACHINE.bodies).max()
    assert widest - 10 < height < widest + 10, "of the lowest contact, some mm above the stock's end"


def test_remedies_shorten_the_post_and_come_in_their_order(standing, advice):
    lengths = [remedy["length_mm"] for remedy in advice["remedies"]]
    assert lengths == sorted(lengths)
    assert len(lengths) == 3
    assert lengths[-1] < standing[1].holding.length


def test_a_remedy_taken_gives_the_length_that_it_told(standing, advice):
    setup, job = standing
    told = {remedy["change"]: remedy["length_mm"] for remedy in advice["remedies"]}
    steep = replace(job, path=replace(job.path, max_tilt_deg=STEEP_TILT))
    _, found = find_post_length(setup, steep, LIMITS)
    assert found.holding.length == told[f"path.max_tilt_deg = {STEEP_TILT:g}"]


def test_the_shorter_the_post_the_more_stays_uncut(standing, advice):
    setup, job = standing
    long, short = advice["shorter"]
    assert short["length_mm"] < long["length_mm"] < job.holding.length
    assert 0 < long["uncut_mm2"] < short["uncut_mm2"] < 0.1 * setup.part.mesh.area


def test_a_post_from_which_nothing_is_reached_is_refused_with_the_length_that_reaches_something(standing):
    """With a level tool the nose is below the table's plane on any post shorter than half of its width."""
    setup, job = standing
    machine = replace(read_machine("mill-4axis"), nose=(Frustum(150.0, 150.0, 150.0),))
    limits = machine_limits(machine)
    check_reached(setup, job, limits)
    low = setup.lift(20.0 - job.holding.length)
    short = replace(job, holding=replace(job.holding, length=20.0))
    with pytest.raises(OrientationError, match=r"length = 20: no contact .* give length = 0") as caught:
        check_reached(low, short, limits)
    needed = float(re.search(r"the first one (\d+) mm", str(caught.value))[1])
    assert 75.0 - np.ptp(setup.stock.bounds[:, 2]) < needed < 85.0


def test_a_lift_is_the_largest_that_any_slice_asks_for_over_table_and_columns():
    random = np.random.default_rng(3)
    columns = Column(14.0, 20.0, 0.0), Column(40.0, 6.0, 0.0)
    clamping = Clamping(columns, closed=True, clearance=1.0, stub=Column(6.0, 30.0, 20.0))
    centres = random.normal(size=(40, 3)) * [9.0, 9.0, 12.0] + [0.0, 0.0, 36.0]
    axes = unit(random.normal(size=(60, 3)))
    found = needed_lifts(centres, axes, FINISHING_CUTTER, clamping)
    expected = np.full(found.shape, -np.inf)
    low, over = np.maximum(-axes[:, 2], 0.0) * LEAVING, 0
    flat = np.hypot(axes[:, 0], axes[:, 1])
    for section in FINISHING_CUTTER.profile:
        count = int(np.ceil((section.end - section.start) / SLICE)) + 1
        for height in np.linspace(section.start, section.end, count) - FINISHING_CUTTER.radius:
            at = centres[:, None] + height * axes
            under = at[..., 2] - section.widest * flat - low
            expected = np.maximum(expected, clamping.clearance + ROOM - under)
            for column in clamping.solids:
                room = clamping.room(column, section.name) + ROOM
                near = np.hypot(at[..., 0], at[..., 1]) < column.radius + room + section.widest
                over += near.sum()
                expected = np.where(near, np.maximum(expected, room + column.top - under), expected)
    assert over > 1000
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert (found > clamping.clearance + ROOM).any()


NOTHING = Clamping((), closed=True, clearance=1.0)


def test_contacts_that_no_post_helps_are_left_out_of_its_length():
    assert shortest_post(np.array([3.2, np.inf, -1.0]), 10.0, NOTHING) == 14.0


def test_no_contact_that_is_reached_is_an_error_and_not_the_shortest_post():
    with pytest.raises(OrientationError, match="no contact has a free tool axis, however long the post is"):
        shortest_post(np.array([np.inf, np.inf, -np.inf]), 10.0, NOTHING)


ANGLE = np.linspace(0, 2 * np.pi, 24, endpoint=False)
TUBE = skin([np.column_stack([3 * np.cos(ANGLE), 3 * np.sin(ANGLE), np.full(24, z)]) for z in (0.0, 4.0, 8.0)], 0.01)
ROD = cylinder(3.05, 0.0, 8.0, 0.01)
CASING = cylinder(9.0, 12.0, 14.0, 0.05)


def test_a_casing_beside_it_carries_no_surface():
    carrying = carrying_solid(TUBE, side_by_side([CASING, ROD]))
    assert np.abs(carrying.bounds - ROD.bounds).max() < 1e-9


def test_a_post_is_as_thick_as_the_underside_and_stands_in_a_collet_where_nothing_is_named():
    found = surface_holding(HoldingJob(), TUBE, ROD)
    assert (found.diameter, found.chuck_diameter, found.chuck_height) == (6.0, 22.0, 100.0)
    named = surface_holding(HoldingJob(length=60.0), TUBE, ROD)
    assert (named.diameter, named.length, named.chuck_height) == (6.0, 60.0, 0.0)
    assert surface_holding(HoldingJob(diameter=2.0, length=60.0), TUBE, ROD).diameter == 2.0


COLLET = {"diameter": 5.0, "chuck_diameter": 22.0, "chuck_height": 100.0, "stub_length": 15.0}


@pytest.fixture(scope="module")
def bar():
    """A round bar of 8 x 30 mm."""
    return read_part(cylinder(4.0, 0.0, 30.0, 0.02), Job(), silent)[0]


def bracketed(bar: Part, **holding: object) -> tuple[Setup, Job]:
    job = Job().with_values(holding={**COLLET, **holding})
    setup = place(bar, job)
    found = settled_bracket(job.holding, setup.part.mesh, LIMITS.bodies.table)
    return setup, replace(job, holding=found)


def test_a_bracket_that_stands_off_takes_little_but_what_is_round_the_pin(bar):
    assert blocked_share(*bracketed(bar), LIMITS) == 0
    assert 0 < blocked_share(*bracketed(bar, tailstock="pin"), LIMITS) < 0.1


def test_a_bracket_in_the_way_of_everything_is_refused(bar):
    """A machine that leans its tool by 40 degrees comes from above alone, where a wide arm is."""
    steep = replace(LIMITS, largest=np.radians(40.0))
    setup, job = bracketed(bar, tailstock="pin", tailstock_length=2.0, tailstock_arm=200.0, tailstock_reach=60.0)
    with pytest.raises(JobError, match=r"tailstock_reach = 60: arm and column stand in the way .* everywhere"):
        blocked_share(setup, job, steep)
    assert blocked_share(setup, replace(job, holding=replace(job.holding, tailstock="none")), steep) == 0


def test_a_tailstock_is_not_blamed_for_what_no_tool_reaches_without_it(bar):
    """A machine whose tool only comes from straight below, where the post is."""
    setup, job = bracketed(bar, tailstock="pin")
    assert blocked_share(setup, job, replace(LIMITS, smallest=np.pi - 0.01, largest=np.pi)) == 0


def test_the_bracket_that_is_found_stands_over_the_part_where_it_is_cut(bar):
    setup, job, _ = find_standing(*bracketed(bar, tailstock="neck", tailstock_diameter=4.0), LIMITS)
    column, *arm = clamping_of(job.holding, LIMITS.bodies.table).beside
    top = float(setup.part.mesh.bounds[1, 2])
    assert setup.post.pin is not None
    assert setup.post.pin.bottom == pytest.approx(top, abs=0.02)
    assert all(one.bottom == pytest.approx(top + 12.0, abs=0.02) for one in arm)
    told = post_report(setup.post, setup.part.mesh, job.holding)["tailstock"]
    assert differences(told | {"blocked_share": 0.1}, TailstockFigures) == []
    assert column.bottom == 0.0
    assert column.top == arm[0].top


def test_a_bracket_over_the_part_leaves_its_parting_groove_free(bar):
    setup, job, _ = find_standing(*bracketed(bar, tailstock="pin", parting=True), LIMITS)
    check_parting(setup, job, LIMITS)
    with pytest.raises(JobError, match=r"parting_stand_off = 15: the groove ends at z .* is kept off"):
        check_parting(setup, job.with_values(holding={"parting_stand_off": 15.0}), LIMITS)
