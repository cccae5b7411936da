"""What is told to make a neck hold does so, when the job has it."""

import numpy as np
import pytest
from typed_values import differences

from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.mesh.part import Part
from bonecam.mesh.solids import cylinder
from bonecam.nc.path_words import machine_limits
from bonecam.planning.estimate import LayersToCut
from bonecam.planning.neck import FREQUENCY_MULTIPLE, LARGEST_SHIFT, neck_figures, neck_remedies, neck_report
from bonecam.report.typed import PostFigures
from bonecam.report.warnings import post_lines
from bonecam.setup.capsule import Capsule
from bonecam.setup.placement import Setup
from bonecam.setup.stock import schedule_of
from bonecam.workholding.post import Post

pytestmark = pytest.mark.whole

LIMITS = machine_limits(read_machine("mikron-ucp600"))
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


def test_a_pin_and_lighter_cuts_are_told_where_each_is_enough() -> None:
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
def test_a_stiffer_cutter_is_told_where_the_cutter_bends_most() -> None:
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


def test_a_neck_that_holds_needs_none() -> None:
    taken, found = remedies(standing(12.0), JOB)
    assert taken.holds
    assert found == ()
    assert "holds_with" not in neck_report([taken], found, JOB, stated=False)


def test_what_is_not_enough_alone_is_told_together() -> None:
    """Its error asks for lighter cuts under a pin, its frequency for slower teeth."""
    taken, (found,) = remedies(standing(110.0), JOB)
    assert not taken.holds
    assert found.neck.holds
    told = found.change.split(" and ")
    assert told[0] == 'holding.tailstock = "pin"'
    assert told[1].startswith("finishing cuts of ")
    assert [change.partition(" ")[0] for change in told[2:]] == ["roughing.spindle", "finishing.spindle"]


def test_where_nothing_is_enough_the_nearest_is_told() -> None:
    taken, found = remedies(standing(110.0), JOB.with_values(material={"name": "titanium"}))
    assert len(found) == 1
    assert not found[0].neck.holds
    assert found[0].neck.shift_um < taken.shift_um


def test_slower_spindles_are_told_where_only_the_teeth_are_too_fast() -> None:
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


def test_report_and_summary_tell_them() -> None:
    taken, found = remedies(standing(50.0), JOB)
    told = {"diameter_mm": 8.0, "length_mm": LOW, "footprint_mm2": 50.0} | neck_report(
        [taken], found, JOB, stated=False
    )
    assert differences(told, PostFigures) == []
    assert told["neck_wanted"]["shift_um"] == pytest.approx(1000 * LARGEST_SHIFT)
    lines = list(post_lines(told))
    assert any('holds with holding.tailstock = "pin": ' in line for line in lines)
    assert neck_report((), (), JOB, stated=False) == {}
