"""Stacks of cylinders and cones: in jobs as text or rows, in cutters from the tip to the spindle.

The ball that holds the end of a bull nose or flat end, and the cones that stand for its body.
"""

import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from bonecam.arrays import lengths
from bonecam.errors import JobError
from bonecam.job import FINISHING, HoldingJob, Job, ToolJob
from bonecam.job.tool_list import read_tool_list
from bonecam.machine.bodies import Frustum, stack_as_text, stack_from_text
from bonecam.planning.collision import cutter_mesh
from bonecam.tool.cutter import Cutter, ToolSection

SHRINK_FIT: Any = [[35, 10, 17], [20, 40]]


def test_a_stack_is_read_from_text_and_from_rows():
    expected = (Frustum(35.0, 10.0, 17.0), Frustum(20.0, 40.0, 40.0))
    assert stack_from_text("35 10 17, 20 40") == stack_from_text(stack_as_text(SHRINK_FIT)) == expected
    assert ToolJob(holder=SHRINK_FIT).holder_stack == expected


def test_a_holder_without_a_stack_is_one_cylinder():
    job = ToolJob(holder_diameter=25.0, holder_length=60.0)
    assert job.holder_stack == (Frustum(60.0, 25.0, 25.0),)


def test_the_sections_of_a_tool_follow_each_other_up_into_the_spindle():
    nose = (Frustum(30.0, 80.0, 80.0), Frustum(50.0, 80.0, 120.0))
    cutter = Cutter.from_job(1, "roughing", ToolJob(holder=SHRINK_FIT, spindle=9000.0, feed=900.0), nose)
    assert cutter.length == 30.0 + 55.0
    assert cutter.profile[2:] == (
        ToolSection("holder", 30.0, 65.0, 5.0, 8.5),
        ToolSection("holder", 65.0, 85.0, 20.0, 20.0),
        ToolSection("spindle", 85.0, 115.0, 40.0, 40.0),
        ToolSection("spindle", 115.0, 165.0, 40.0, 60.0),
    )
    assert all(below.end == above.start for below, above in pairwise(cutter.profile))


NECKED = {"radius": 1.0, "flute_length": 3.0, "neck_diameter": 1.9, "neck_length": 11.0, "overhang": 20.0}


def test_a_neck_is_a_thinner_piece_of_the_shank():
    cutter = Cutter.from_job(2, "finishing", ToolJob(**NECKED, spindle=9000.0, feed=900.0))
    assert cutter.profile[:3] == (
        ToolSection("cutter", 1.0, 3.0, 1.0, 1.0),
        ToolSection("shank", 3.0, 11.0, 0.95, 0.95),
        ToolSection("shank", 11.0, 20.0, 2.0, 2.0),
    )


def test_a_cutter_of_ones_own_does_not_keep_the_neck_of_the_default():
    neck = FINISHING.neck_diameter, FINISHING.neck_length
    assert neck == (1.9, 11.0)
    for own in ({"radius": 0.5, "flute_length": 2.0}, {"shank_diameter": 2.0}):
        tool = Job().with_values(finishing=own).finishing
        assert (tool.neck_diameter, tool.neck_length) == (0.0, 0.0)
    stated = {"radius": 1.0, "neck_diameter": 1.8, "neck_length": 9.0}
    tool = Job().with_values(finishing=stated).finishing
    assert (tool.neck_diameter, tool.neck_length) == (1.8, 9.0)
    kept = Job().with_values(finishing={"scallop": 0.02, "overhang": 22.0}).finishing
    assert (kept.neck_diameter, kept.neck_length) == neck


def test_a_stated_holder_of_one_cylinder_takes_the_place_of_the_default_pieces():
    own = Job().with_values(roughing={"holder_diameter": 25.0}).roughing
    assert own.holder_stack == (Frustum(50.0, 25.0, 25.0),)
    assert Job().roughing.holder_stack == (Frustum(60.0, 10.0, 19.0), Frustum(20.0, 63.0, 63.0))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"neck_length": 3.0}, r"neck_length = 3: give more than flute_length \(3 mm\) and less than overhang"),
        ({"neck_length": 20.0}, r"neck_length = 20: give more than flute_length"),
        ({"neck_length": 0.0}, r"neck_length = 0: give more than flute_length"),
        ({"neck_diameter": 2.1}, r"neck_diameter = 2.1: give a diameter up to that of ball and shank \(2 mm\)"),
        ({"neck_diameter": 0.0}, r"neck_diameter = 0: give a diameter up to"),
        ({"shank_diameter": 1.5}, r"neck_diameter = 1.9: give a diameter up to that of ball and shank \(1.5 mm\)"),
    ],
)
def test_a_neck_that_is_not_between_flutes_and_shank_is_refused(values, message):
    with pytest.raises(JobError, match=rf"\[finishing\] {message}"):
        Cutter.from_job(2, "finishing", ToolJob(**{**NECKED, **values}, spindle=9000.0, feed=900.0))


@pytest.mark.parametrize(
    ("holder", "message"),
    [
        ("35 10 17 3", r"holder = '35 10 17 3': 35 10 17 3: give positive length, diameter"),
        ("35 -10", r"35 -10: give positive length, diameter"),
        ("35 wide", r"'wide' is no number: give rows like '35 10 17, 20 40'"),
        ("5 20," * 25 + "5 20", r"26 pieces: give at most 20"),
        ([3.0], r"holder = '3\.0': 3: give positive length"),
    ],
)
def test_a_holder_that_is_no_stack_is_refused(holder, message):
    with pytest.raises(JobError, match=message):
        ToolJob(holder=holder)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"chuck_height": 20.0}, r"chuck_diameter = 0: give both sizes of the chuck, or none"),
        ({"chuck_diameter": 20.0}, r"chuck_height = 0: give both sizes of the chuck, or none"),
        (
            {"diameter": 4.0, "chuck_diameter": 3.0, "chuck_height": 9.0},
            r"chuck_diameter = 3: give more than the post's diameter",
        ),
        (
            {"length": 40.0, "chuck_diameter": 30.0, "chuck_height": 40.0},
            r"chuck_height = 40: give less than the post's length \(40 mm\), or a longer post",
        ),
    ],
)
def test_a_chuck_that_cannot_hold_the_post_is_refused(values, message):
    with pytest.raises(JobError, match=message):
        HoldingJob(**values)


def test_a_cutter_without_speeds_is_a_wrong_call():
    with pytest.raises(ValueError, match=r"take the cutter of Job\.tool\('roughing'\)"):
        Cutter.from_job(1, "roughing", ToolJob())


def test_each_cutter_that_ships_can_be_made_and_those_with_a_neck_are_thin_there_only():
    necks = 0
    for name in (listed.name for listed in read_tool_list("")):
        job = Job().with_values(finishing={"preset": name, "spindle": 9000.0, "feed": 500.0})
        cutter = Cutter.from_job(2, "finishing", job.finishing)
        if "-neck-" in name:
            found = re.fullmatch(r"ball-(.*)-neck-(.*)-shank-(.*)", name)
            assert found
            size, length, shank = found.groups()
            assert (2 * cutter.radius, cutter.neck_length) == (float(size), float(length))
            assert cutter.shank_diameter == float(shank) > cutter.neck_diameter
            necks += 1
    assert necks == 14


def test_a_tool_has_the_number_of_the_job_and_two_tools_have_two():
    numbered = Job().with_values(roughing={"number": 12})
    assert Cutter.from_job(1, "roughing", numbered.tool("roughing")).number == 12
    assert Cutter.from_job(2, "finishing", numbered.tool("finishing")).number == 2
    with pytest.raises(
        JobError, match=r"^\[finishing\] number = 2: \[roughing\] has this tool number too: give"
    ) as caught:
        Job().with_values(roughing={"number": 2})
    assert caught.value.evidence["field"] == "number"
    # the cutter for hollows counts where it is used
    with pytest.raises(JobError, match=r"\[fine\] number = 3: \[roughing\] has this"):
        Job().with_values(roughing={"number": 3}, path={"fine_cutter": True})
    assert Job().with_values(roughing={"number": 3}).roughing.number == 3


def test_a_cutter_s_own_flutes_feed_and_load_it_and_no_other():
    two, four = Job(), Job().with_values(finishing={"flutes": 4})
    assert (four.tool("finishing").flutes, four.tool("roughing").flutes) == (4, 2)
    assert four.tool("roughing") == two.tool("roughing")
    assert four.tool("finishing").spindle == two.tool("finishing").spindle
    assert four.tool("finishing").feed == pytest.approx(2 * two.tool("finishing").feed, abs=2.0)
    assert Cutter.from_job(2, "finishing", four.tool("finishing")).flutes == 4
    assert Job().with_values(mechanics={"flutes": 3}).tool("fine").flutes == 3


@pytest.mark.parametrize("shape", ["bull", "flat"])
@pytest.mark.parametrize("section", ["roughing", "finishing", "fine"])
def test_only_balls_cut(section, shape):
    with pytest.raises(JobError, match=rf"\[{section}\] shape = '{shape}'.*: choose one of ball"):
        Job().with_values(**{section: {"shape": shape}})


def test_flutes_must_reach_the_middle_of_the_ball():
    with pytest.raises(JobError, match=r"flute_length = 1: give at least the ball's radius \(2 mm\)"):
        Cutter.from_job(1, "roughing", Job().with_values(roughing={"flute_length": 1.0}).tool("roughing"))


@pytest.mark.parametrize("slack", [0.0, 0.01])
def test_the_mesh_for_fcl_lies_inside_the_ball_by_the_slack(slack):
    cutter = Cutter.from_job(1, "roughing", Job().tool("roughing"))
    vertices = cutter_mesh(cutter, slack).vertices
    low = vertices[(vertices[:, 2] <= cutter.radius) & (vertices[:, 2] > slack)]
    np.testing.assert_allclose(lengths(low - [0.0, 0.0, cutter.radius]), cutter.radius - slack, atol=1e-9)


def test_centres_and_tips_lie_the_height_of_the_ball_apart_along_each_axis():
    cutter = Cutter.from_job(1, "roughing", Job().tool("roughing"))
    axes = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
    tips = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    centres = cutter.centres_of(tips, axes)
    np.testing.assert_allclose(centres[1], cutter.radius * axes[1])
    np.testing.assert_allclose(cutter.tips_of(centres, axes), tips)
    assert cutter.tips_of(centres[0], axes[0]).shape == (3,)
