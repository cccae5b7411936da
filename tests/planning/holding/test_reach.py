"""What would shorten a post: every remedy is the length that is found with it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import OrientationError
from bonecam.job import Job
from bonecam.machine.bodies import Frustum
from bonecam.machine.machine import read_machine
from bonecam.nc.path_words import machine_limits
from bonecam.planning.post_length import STEEP_TILT, check_reached, find_post_length, level_lifts, what_would_help
from bonecam.progress import silent
from bonecam.setup.placement import place
from bonecam.surface.files.surface_input import read_part

PHALANX = Path(__file__).parents[3] / "meshes/phalanx.ply"
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
