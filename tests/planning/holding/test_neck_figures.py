"""What a neck is told to hold follows from its beam: the error kept, the stress of the cuts that it bears, the lowest
frequency."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.mechanics.edges import job_strip_force
from bonecam.mechanics.loads import mechanics_of_job
from bonecam.mesh.part import Part
from bonecam.mesh.solids import cylinder
from bonecam.nc.path_words import machine_limits
from bonecam.planning.estimate import LayersToCut
from bonecam.planning.neck import PEAK_SHARE, Neck, finished_beam, neck_figures, with_found_depths
from bonecam.setup.capsule import Capsule
from bonecam.setup.placement import Setup
from bonecam.setup.stock import schedule_of
from bonecam.workholding.post import Post

LIMITS = machine_limits(read_machine("mikron-ucp600"))
RADIUS, LOW, TOP = 6.0, 120.0, 150.0
HOLDING = {
    "diameter": 6.0,
    "length": LOW,
    "chuck_diameter": 28.0,
    "chuck_height": 100.0,
    "stub_diameter": 13.0,
    "stub_length": 15.0,
}
JOB = Job(holding=HOLDING)
STATED = JOB.with_values(levels={"roughing_depth": 1.0})


def standing(more: float, high: float = TOP) -> Setup:
    """A bar of 12 mm on its neck, in a stock that is `more` mm larger all round."""
    stock = Capsule(np.array([0.0, 0, LOW]), np.array([0.0, 0, high]), RADIUS + more)
    mesh = cylinder(RADIUS, LOW, high, 0.01)
    part = Part(mesh, "", len(mesh.faces), "mm", (), np.eye(4), mesh)
    return Setup(part, stock, Post(3.0, LOW), schedule_of(JOB.levels))


def figures(setup: Setup, job: Job) -> Neck:
    """The figures of the neck of a job."""
    return neck_figures(setup, job, LIMITS, LayersToCut.between(setup.part.mesh, setup.stock.mesh(0.05)))


def test_the_stress_is_that_of_the_cuts_that_the_neck_bears() -> None:
    setup = standing(3.0)
    open_ = figures(setup, JOB)
    made = with_found_depths(setup, JOB, LIMITS)
    assert made.levels.listed != JOB.levels.listed
    stiffness, force = mechanics_of_job(JOB)
    beam = finished_beam(setup.part.mesh, setup.post, JOB.holding, stiffness)
    peak = PEAK_SHARE * job_strip_force(force, made, "roughing")
    by_hand = beam.moment_stress(np.array([[peak, 0.0, 0.0]]), np.array([[0.0, 0.0, (LOW + TOP) / 2]]))[0]
    assert open_.stress_mpa == pytest.approx(by_hand)
    assert open_.machining_min is not None
    assert figures(setup, STATED).machining_min is None


def test_a_heavy_stock_swings_slower_than_the_part() -> None:
    bare, heavy = (figures(standing(more), STATED).first_hz for more in (0.01, 4.0))
    assert heavy < 0.9 * bare


def test_a_slender_part_does_not_hold_on_a_neck_that_holds_a_stubby_one() -> None:
    assert figures(standing(1.0), STATED).holds
    slender = figures(standing(1.0, high=220.0), STATED)
    assert not slender.holds
    thin = STATED.with_values(holding={"diameter": 2.0})
    assert not figures(replace(standing(1.0), post=Post(1.0, LOW)), thin).holds
