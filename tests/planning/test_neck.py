"""The neck that is found holds by its own beam, is the thinnest that does, and stands clear of stub and chuck.

What is told to make a neck hold does so, when the job has it.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typed_values import differences

from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.job.materials.preset import read_material
from bonecam.machine import read_machine
from bonecam.mechanics import Beam, column_sections
from bonecam.mesh import Part
from bonecam.mesh.solids import cylinder
from bonecam.nc import machine_limits
from bonecam.planning import find_standing
from bonecam.planning.estimate import LayersToCut
from bonecam.planning.neck import (
    FREQUENCY_MULTIPLE,
    LARGEST_SHIFT,
    Neck,
    finished_beam,
    neck_figures,
    neck_remedies,
    neck_report,
    ranking,
)
from bonecam.planning.post_length import find_post_length, needed_lifts
from bonecam.progress import silent
from bonecam.report.typed import NeckFigures, PostFigures
from bonecam.report.warnings import neck_remedy_text
from bonecam.setup import Capsule, Setup, place, schedule_of
from bonecam.surface.files.surface_input import read_part
from bonecam.tool import Cutter
from bonecam.workholding import Clamping, Post, clamping_of
from bonecam.workholding.clamping import LEAST_NECK
from bonecam.workholding.post import NECKS, Column, settled_stub

pytestmark = pytest.mark.whole


PHALANX = Path(__file__).parents[2] / "meshes/phalanx.ply"
LIMITS = machine_limits(read_machine("mikron-ucp600"))
OPEN = Job().with_values(holding={"diameter": 0.0})


@pytest.fixture(scope="module")
def found():
    """The phalanx on the neck that is found for it."""
    unplaced, _ = read_part(PHALANX, OPEN, silent)
    setup = place(unplaced, OPEN)
    return find_standing(setup, replace(OPEN, holding=settled_stub(OPEN.holding, setup.stock.diameter)), LIMITS)


def test_the_neck_that_is_taken_is_the_thinnest_that_holds(found):
    _, job, necks = found
    assert necks[0].holds
    assert job.holding.diameter == necks[0].diameter in NECKS
    assert all(neck.diameter > necks[0].diameter for neck in necks[1:] if neck.holds)
    assert all(np.diff([neck.left_mm2 for neck in sorted(necks, key=lambda one: one.diameter)]) > 0)
    assert all(np.diff([neck.um_per_n for neck in sorted(necks, key=lambda one: one.diameter)]) < 0)


def test_a_neck_that_gives_way_at_the_length_of_all_contacts_is_not_taken(found, monkeypatch):
    """With all contacts the thinnest neck that held is 30 mm longer."""
    setup, job, necks = found
    given = job.with_values(holding={"diameter": 0.0, "length": 0.0})

    def longer(setup, job, limits):
        setup, job = find_post_length(setup, job, limits)
        more = 30.0 * (job.holding.diameter == necks[0].diameter)
        return setup.lift(more), job.with_values(holding={"length": job.holding.length + more})

    monkeypatch.setattr("bonecam.planning.neck.stand_on_post", longer)
    _, other, tried = find_standing(setup, given, LIMITS)
    assert other.holding.diameter == tried[0].diameter > necks[0].diameter
    assert tried[0].holds
    (left,) = (neck for neck in tried if neck.diameter == necks[0].diameter)
    assert not left.holds
    assert left.length == necks[0].length + 30.0


def test_stock_neck_and_stub_stand_on_one_another(found):
    setup, job, necks = found
    clamping = clamping_of(job.holding, LIMITS.bodies.table)
    assert setup.stock.bounds[0, 2] == pytest.approx(job.holding.length)
    assert job.holding.length - clamping.stub.top == pytest.approx(necks[0].length)
    assert necks[0].length >= LEAST_NECK
    assert setup.post.top > job.holding.length
    assert 2 * clamping.stub.radius >= setup.stock.diameter


def test_the_beam_of_a_cylinder_on_its_neck_is_that_of_its_pieces():
    job = OPEN.with_values(
        holding={
            "diameter": 6.0,
            "chuck_diameter": 28.0,
            "chuck_height": 100.0,
            "stub_diameter": 13.0,
            "stub_length": 15.0,
        }
    )
    stiffness = read_material("aluminium").stiffness
    part = cylinder(6.0, 120.0, 150.0, 0.001)
    beam = finished_beam(part, Post(3.0, 120.0), job.holding, stiffness)
    tip = np.array([[0.0, 0.0, 150.0]])
    second = np.pi / 4 * np.array([6.5, 3.0, 6.0]) ** 4
    ends = np.array([[100.0, 115.0], [115.0, 120.0], [120.0, 150.0]])
    bent = sum(((150 - low) ** 3 - (150 - high) ** 3) / 3 / each for (low, high), each in zip(ends, second))
    turns = [(0.24 * 6 * (1 - (6 / wide) ** 2), 150 - at) for wide, at in ((13.0, 115.0), (12.0, 120.0))]
    bent += sum(length * arm**2 for length, arm in turns) / second[1]
    whole = beam.compliance(tip)[0, 0, 0]
    shear = whole - bent / stiffness.elasticity
    assert 0 < shear < 0.06 * whole, "what is left is shear"
    alone = Beam(column_sections(3.0, 0.0, 10.0), stiffness.elasticity)
    assert alone.compliance(np.array([[0.0, 0, 10.0]]))[0, 0, 0] > 0


def necks_of(*rows: tuple[float, float, bool], minutes: Sequence[float | None] = ()) -> list[Neck]:
    """Necks of a diameter and a shift (um) that hold or not, with cuts that take these minutes."""
    times = minutes or [None] * len(rows)
    return [
        Neck(d, 5.0, 120.0, 10.0, 1.0, shift, 10.0, 900.0, 1.5 * shift, holds, machining_min=time)
        for (d, shift, holds), time in zip(rows, times, strict=True)
    ]


def test_where_none_holds_the_stiffest_is_taken():
    none = ranking(necks_of((4.0, 90.0, False), (6.0, 40.0, False), (8.0, 44.0, False)))
    assert [neck.diameter for neck in none] == [6.0, 8.0, 4.0]
    some = ranking(necks_of((4.0, 90.0, False), (6.0, 9.0, True), (8.0, 4.0, True)))
    assert [neck.diameter for neck in some] == [6.0, 8.0, 4.0]
    assert neck_report((), (), OPEN, stated=False) == {}
    assert neck_report(some, (), OPEN, stated=False)["necks"][0] == some[0].report
    assert differences(some[0].report, NeckFigures) == []


def test_a_thin_neck_whose_cuts_take_much_longer_is_not_taken():
    rows = (4.0, 90.0, False), (5.0, 14.0, True), (6.0, 9.0, True), (8.0, 4.0, True)
    slow = ranking(necks_of(*rows, minutes=(5.0, 14.0, 11.5, 10.0)))
    assert [neck.diameter for neck in slow] == [6.0, 8.0, 5.0, 4.0]
    even = ranking(necks_of(*rows, minutes=(5.0, 10.5, 10.0, 10.0)))
    assert [neck.diameter for neck in even] == [5.0, 6.0, 8.0, 4.0]
    assert differences(slow[0].report, NeckFigures) == []
    assert slow[0].report["machining_min"] == 11.5


def test_the_report_tells_the_time_of_the_cuts_of_each_neck():
    timed = neck_report(necks_of((6.0, 9.0, True), minutes=(11.5,)), (), OPEN, stated=False)
    assert [neck["machining_min"] for neck in timed["necks"]] == [11.5]
    stated = neck_report(necks_of((6.0, 9.0, True)), (), OPEN, stated=True)
    assert "machining_min" not in stated["necks"][0]


def test_a_cut_that_takes_more_force_wants_a_thicker_neck(found):
    setup, job, necks = found
    deep = {"levels": {"finishing_depth": 0.3}, "finishing": {"scallop": 0.1}}
    _, other, tried = find_standing(setup, job.with_values(**deep, holding={"diameter": 0.0, "length": 0.0}), LIMITS)
    assert other.holding.diameter > necks[0].diameter
    assert tried[0].holds


def test_titanium_wants_a_stiffer_cutter_or_lighter_cuts_than_a_neck_can_mend(found):
    """Its edges push along the normal, so that the finishing cutter alone gives way by more than 16 um."""
    setup, job, necks = found
    hard = job.with_values(material={"name": "titanium"}, holding={"diameter": 0.0, "length": 0.0})
    stood, other, tried = find_standing(setup, hard, LIMITS)
    assert other.holding.diameter == tried[0].diameter > necks[0].diameter
    assert not tried[0].holds
    lighter, *stiffer = neck_remedies(stood, other, LIMITS, tried[0])
    assert all(remedy.neck.holds for remedy in (lighter, *stiffer))
    assert lighter.change.startswith("finishing cuts of 0.0")
    assert all("finishing.preset" in remedy.change for remedy in stiffer)


def test_a_stock_thinner_than_every_neck_is_refused(found):
    setup, job, _ = found
    thin = type(setup.stock)(setup.stock.start, setup.stock.end, 1.9)
    with pytest.raises(JobError, match=r"diameter = 0.*the stock is 3.80 mm wide"):
        find_standing(replace(setup, stock=thin), job.with_values(holding={"diameter": 0.0}), LIMITS)


def test_a_stub_lifts_what_would_cut_it_and_holders_more():
    """A level tool over a stub: its ball may be nearer to it than its holder."""
    cutter = Cutter.from_job(1, "roughing", replace(OPEN.tool("roughing"), overhang=40.0))
    level = np.array([[1.0, 0.0, 0.0]])
    stub = Column(5.0, 60.0, 0.0)
    near = Clamping(stub=stub, closed=False)
    at = np.array([[0.0, 0.0, 60.0 + cutter.radius]])
    ball = needed_lifts(at, level, cutter, near)[0, 0]
    holder = needed_lifts(at - [cutter.overhang, 0.0, 0.0], level, cutter, near)[0, 0]
    radius = cutter.holder[0].top_diameter / 2
    assert holder - ball == pytest.approx(radius - cutter.radius + near.clearance - 0.5)


LOW = 118.0
JOB = Job(
    holding={
        "diameter": 8.0,
        "length": LOW,
        "chuck_diameter": 28.0,
        "chuck_height": 100.0,
        "stub_diameter": 18.0,
        "stub_length": 15.0,
    },
    levels={"roughing_depth": 1.0, "finishing_depth": 0.3},
    finishing={"scallop": 0.1},
)


def standing(length: float) -> Setup:
    """A bar of 10 mm on its neck, in a stock of 16."""
    stock = Capsule(np.array([0.0, 0, LOW]), np.array([0.0, 0, LOW + length]), 8.0)
    mesh = cylinder(5.0, LOW, LOW + length, 0.01)
    part = Part(mesh, "", len(mesh.faces), "mm", (), np.eye(4), mesh)
    return Setup(part, stock, Post(4.0, LOW), schedule_of(JOB.levels))


def remedies(setup: Setup, job: Job):
    """The neck of a job, and its remedies."""
    layers = LayersToCut.between(setup.part.mesh, setup.stock.mesh(0.05))
    taken = neck_figures(setup, job, LIMITS, layers)
    return taken, neck_remedies(setup, job, LIMITS, taken)


def test_a_pin_and_lighter_cuts_are_told_where_each_is_enough():
    setup = standing(50.0)
    taken, found = remedies(setup, JOB)
    assert not taken.holds
    pin, lighter, *stiffer = found
    assert all("finishing.preset" in remedy.change and remedy.neck.holds for remedy in stiffer)
    assert pin.change == 'holding.tailstock = "pin"'
    assert pin.neck.holds
    assert pin.neck.tailstock == "pin"
    assert lighter.change.startswith("finishing cuts of ")
    depth, scallop = (float(lighter.change.split()[k]) for k in (3, 8))
    followed = JOB.with_values(levels={"finishing_depth": depth}, finishing={"scallop": scallop})
    assert remedies(setup, followed)[0] == lighter.neck
    assert lighter.neck.holds
    halved = JOB.with_values(levels={"finishing_depth": 0.15}, finishing={"scallop": 0.05})
    assert depth == 0.15 or not remedies(setup, halved)[0].holds, "no lighter than is needed"


@pytest.mark.slow
def test_a_stiffer_cutter_is_told_where_the_cutter_bends_most():
    slim = {"radius": 1.0, "flute_length": 3.0, "shank_diameter": 4.0, "neck_diameter": 1.4, "neck_length": 16.0}
    job = JOB.with_values(finishing={**slim, "overhang": 25.0})
    taken, found = remedies(standing(25.0), job)
    assert not taken.holds
    (stiffer,) = (one for one in found if "preset" in one.change)
    assert stiffer.neck.holds
    preset = stiffer.change.split('"')[1]
    followed = job.with_values(finishing={"preset": preset, "scallop": job.finishing.scallop})
    assert remedies(standing(25.0), followed)[0] == stiffer.neck
    assert stiffer.neck.um_per_n == taken.um_per_n, "the part is no stiffer"


def test_a_neck_that_holds_needs_none():
    taken, found = remedies(standing(12.0), JOB)
    assert taken.holds
    assert found == ()
    assert "holds_with" not in neck_report([taken], found, JOB, stated=False)


def test_what_is_not_enough_alone_is_told_together():
    """Its error asks for lighter cuts under a pin, its frequency for slower teeth."""
    taken, (found,) = remedies(standing(110.0), JOB)
    assert not taken.holds
    assert found.neck.holds
    told = found.change.split(" and ")
    assert told[0] == 'holding.tailstock = "pin"'
    assert told[1].startswith("finishing cuts of ")
    assert [change.partition(" ")[0] for change in told[2:]] == ["roughing.spindle", "finishing.spindle"]


def test_where_nothing_is_enough_the_nearest_is_told():
    taken, found = remedies(standing(110.0), JOB.with_values(material={"name": "titanium"}))
    assert len(found) == 1
    assert not found[0].neck.holds
    assert found[0].neck.shift_um < taken.shift_um


def test_slower_spindles_are_told_where_only_the_teeth_are_too_fast():
    fast = JOB.with_values(
        mechanics={"flutes": 4}, **{name: {"spindle": 40000.0, "feed": 4000.0} for name in ("roughing", "finishing")}
    )
    taken, found = remedies(standing(25.0), fast)
    assert not taken.holds
    (change,) = (one.change for one in found if "spindle" in one.change)
    speed = float(change.split()[2])
    assert change == f"roughing.spindle = {speed:g} and finishing.spindle = {speed:g}"
    followed = fast.with_values(**{name: {"spindle": speed} for name in ("roughing", "finishing")})
    assert remedies(standing(25.0), followed)[0].holds
    assert speed * 4 / 60 * FREQUENCY_MULTIPLE == pytest.approx(taken.first_hz, abs=10.0)


def test_report_and_warning_tell_them():
    taken, found = remedies(standing(50.0), JOB)
    told = {"diameter_mm": 8.0, "length_mm": LOW, "footprint_mm2": 50.0} | neck_report(
        [taken], found, JOB, stated=False
    )
    assert differences(told, PostFigures) == []
    assert told["neck_wanted"]["shift_um"] == pytest.approx(1000 * LARGEST_SHIFT)
    assert 'holds with holding.tailstock = "pin": ' in neck_remedy_text(told)
    assert neck_report((), (), JOB, stated=False) == {}
