"""Depths that are found are the deepest that ball, neck and part bear, cut by cut from the part outwards.

What a neck is told to hold follows from its beam: the error kept, the stress of the cuts that it bears, the lowest
frequency.

The error that is foretold is the share of an exponential distribution whose mean follows the compliance.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bonecam.job import Job, LevelsJob, read_job, write_job
from bonecam.machine import read_machine
from bonecam.mechanics import Beam, column_sections
from bonecam.mechanics.edges import cutter_compliance, job_strip_force
from bonecam.mechanics.loads import mechanics_of_job
from bonecam.mesh import Part
from bonecam.mesh.solids import cylinder
from bonecam.nc import machine_limits
from bonecam.planning.estimate import LayersToCut
from bonecam.planning.neck import (
    BALL_SHARE,
    FORCE_SHARE,
    PEAK_SHARE,
    SCALLOP_SHARE,
    YIELD_SHARE,
    Neck,
    depths_report,
    finished_beam,
    foretold_errors,
    found_depths,
    leaves_depths_open,
    neck_figures,
    normal_compliance,
    normal_compliances,
    preferred_depths,
    with_found_depths,
)
from bonecam.setup import Capsule, Setup, schedule_of
from bonecam.tool import Cutter
from bonecam.workholding import Post

LIMITS = machine_limits(read_machine("mikron-ucp600"))
HOLDING = {"diameter": 6.0, "chuck_diameter": 28.0, "chuck_height": 100.0, "stub_diameter": 13.0, "stub_length": 15.0}
FOUND = Job(levels={"depths": "found"}, holding=HOLDING)
RADIUS, LOW, TOP = 6.0, 120.0, 150.0
JOB = Job(holding={**HOLDING, "length": LOW})
STATED = JOB.with_values(levels={"roughing_depth": 1.0})
TRIED = preferred_depths(0.1, 1.0)


def read_job_of(text: str, folder: Path) -> Job:
    """The job of a text."""
    file = folder / "job.toml"
    file.write_text(text)
    return read_job(file)


def standing(more: float, high: float = TOP, job: Job = JOB) -> Setup:
    """A bar of 12 mm on its neck, in a stock that is `more` mm larger all round."""
    stock = Capsule(np.array([0.0, 0, LOW]), np.array([0.0, 0, high]), RADIUS + more)
    mesh = cylinder(RADIUS, LOW, high, 0.01)
    part = Part(mesh, "", len(mesh.faces), "mm", (), np.eye(4), mesh)
    return Setup(part, stock, Post(3.0, LOW), schedule_of(job.levels))


@pytest.fixture(scope="module")
def setup():
    return standing(5.0, job=FOUND)


def borne(job: Job, setup: Setup, depth: float, under: float) -> bool:
    """Whether the roughing cut of a depth holds by the beam, by hand."""
    stiffness, force = mechanics_of_job(job)
    one = job.with_values(levels={"depths": f"{depth}"}, roughing={"scallop": max(0.05, SCALLOP_SHARE * depth)})
    peak = PEAK_SHARE * job_strip_force(force, one, "roughing")
    beam = finished_beam(setup.part.mesh, setup.post, job.holding, stiffness)
    tool = cutter_compliance(Cutter.from_job(1, "roughing", one.tool("roughing"), LIMITS.bodies.nose))
    side = np.array([[peak, 0.0, 0.0]])
    stress = float(beam.moment_stress(side, np.array([[0.0, 0.0, (LOW + TOP) / 2]]))[0])
    bent = peak * (normal_compliance(beam, setup.part.mesh) + tool)
    return bent <= under and stress <= YIELD_SHARE * stiffness.yield_strength


@pytest.mark.parametrize("material", ["aluminium", "titanium", "peek"])
def test_each_cut_is_the_deepest_that_is_borne_over_those_inside_it(setup, material):
    job = FOUND.with_values(material={"name": material})
    made = with_found_depths(setup, job, LIMITS)
    depths = made.levels.listed
    tried = preferred_depths(0.1, BALL_SHARE * job.roughing.radius)
    assert depths[0] == job.levels.finishing_depth
    assert list(depths) == sorted(depths)
    for k, depth in enumerate(depths[1:], 1):
        under = sum(depths[:k])
        deepest = max([d for d in tried if borne(job, setup, d, under)], default=depths[k - 1])
        assert depth == pytest.approx(max(deepest, depths[k - 1]))
    assert made.scallop(len(depths)) == pytest.approx(max(0.05, SCALLOP_SHARE * depths[-1]))


def test_a_share_of_scallops_that_is_stated_holds_beside_found_depths(setup):
    made = with_found_depths(setup, FOUND.with_values(levels={"scallop_share": 0.3}), LIMITS)
    assert made.levels.scallop_share == 0.3
    assert made.scallop(len(made.levels.listed)) == pytest.approx(0.3 * made.levels.listed[-1])


def test_a_neck_near_its_strength_keeps_all_cuts_shallow(setup):
    thin = FOUND.with_values(holding={"diameter": 3.0})
    depths = with_found_depths(replace(setup, post=Post(1.5, LOW)), thin, LIMITS).levels.listed
    assert depths[-1] < BALL_SHARE * FOUND.roughing.radius


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({}, True),
        ({"levels": {"finishing_depth": 0.2}}, True),
        ({"levels": {"roughing_depth": 0.5}}, False),
        ({"levels": {"finishing_levels": 2}}, False),
        ({"levels": {"depths": "0.1 0.3"}}, False),
        ({"levels": {"schedule": "fewest"}}, False),
        pytest.param({"levels": {"method": "published"}}, False, marks=pytest.mark.plugged),
        ({"path": {"pattern": "published"}}, False),
        pytest.param({"path": {"strategy": "rotary"}}, False, marks=pytest.mark.plugged),
        pytest.param({"levels": {"depths": "found"}, "path": {"strategy": "rotary"}}, True, marks=pytest.mark.plugged),
    ],
)
def test_depths_are_found_where_none_is_stated(changes, found, tmp_path):
    job = Job().with_values(**changes)
    assert leaves_depths_open(job, neck_found=True) == found
    assert leaves_depths_open(job, neck_found=False) == job.levels.found
    assert leaves_depths_open(read_job_of(write_job(job), tmp_path), neck_found=True) == found


def test_numbers_that_are_given_to_the_section_itself_hold():
    assert not leaves_depths_open(Job(levels=LevelsJob(roughing_depth=1.0)), neck_found=True)


def test_depths_grow_with_what_stands_under_them():
    assert found_depths(0.1, TRIED, 50.0, lambda depth, under: depth <= 2 * under) == (0.1, 0.2, 0.5, 1.0)
    assert found_depths(0.1, TRIED, 50.0, lambda depth, under: under >= 0.3) == (0.1, 0.1, 0.1, 1.0)
    assert found_depths(0.1, TRIED, 50.0, lambda depth, under: depth < 0.45) == (0.1, 0.4)
    assert found_depths(0.1, TRIED, 0.5, lambda *_: False) == (0.1,)
    assert found_depths(0.1, [], 50.0, lambda *_: True) == (0.1,)


def test_preferred_depths_lie_between_the_finishing_cut_and_the_deepest():
    assert TRIED == [0.125, 0.16, 0.2, 0.25, 0.315, 0.4, 0.5, 0.63, 0.8, 1.0]
    assert preferred_depths(0.3, 0.375) == [0.315, 0.375]
    assert preferred_depths(1.0, 0.5) == []


def test_the_report_tells_the_depths_that_were_found():
    made = FOUND.with_values(levels={"depths": "0.1 0.25 1"})
    assert depths_report(made) == {"depths_found": [0.1, 0.25, 1.0]}


def figures(setup: Setup, job: Job) -> Neck:
    """The figures of the neck of a job."""
    return neck_figures(setup, job, LIMITS, LayersToCut.between(setup.part.mesh, setup.stock.mesh(0.05)))


def test_the_stress_is_that_of_the_cuts_that_the_neck_bears():
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


def test_a_heavy_stock_swings_slower_than_the_part():
    bare, heavy = (figures(standing(more), STATED).first_hz for more in (0.01, 4.0))
    assert heavy < 0.9 * bare


def test_a_slender_part_does_not_hold_on_a_neck_that_holds_a_stubby_one():
    assert figures(standing(1.0), STATED).holds
    slender = figures(standing(1.0, high=220.0), STATED)
    assert not slender.holds
    thin = STATED.with_values(holding={"diameter": 2.0})
    assert not figures(replace(standing(1.0), post=Post(1.0, LOW)), thin).holds


ALUMINIUM = 69000.0
BAR = cylinder(3.0, 0.0, 60.0, 0.01)
BEAM = Beam(column_sections(3.0, 0.0, 60.0), ALUMINIUM)


def test_on_a_rigid_part_the_errors_are_those_of_the_cutter_in_the_shares_of_the_distribution():
    rigid = Beam(BEAM.sections, 1e15)
    p50, p95, p99 = foretold_errors(rigid, BAR, 0.0012, 10.0, (0.5, 0.95, 0.99))
    assert p95 == pytest.approx(0.0012 * 10.0 * FORCE_SHARE * np.log(20), rel=1e-6)
    assert p99 / p95 == pytest.approx(np.log(100) / np.log(20))
    assert p50 / p95 == pytest.approx(np.log(2) / np.log(20))


def test_the_shares_are_those_of_errors_drawn_at_places_of_the_area():
    found, areas = normal_compliances(BEAM, BAR)
    random = np.random.default_rng(1)
    places = random.choice(len(areas), 400_000, p=areas / areas.sum())
    drawn = 8.0 * FORCE_SHARE * (found[places] + 0.001) * random.exponential(size=len(places))
    told = foretold_errors(BEAM, BAR, 0.001, 8.0, (0.95, 0.99))
    assert told == pytest.approx(np.quantile(drawn, (0.95, 0.99)), rel=0.02)
