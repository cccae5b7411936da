"""What a program is expected to take, before it is planned.

What a cut leaves to the next one.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from small_parts import grooved_pebble

from bonecam.job import Job
from bonecam.levels.measure import NO_CUT, MorphLevel, PartLevel, StockLevel
from bonecam.machine.bodies import MachineBodies
from bonecam.planning.estimate import (
    BLOCK_FACTOR,
    LENGTH_FACTOR,
    MINUTES_A_LEVEL,
    TIME_FACTOR,
    LayersToCut,
    estimate,
    least_depth,
)
from bonecam.setup.capsule import Capsule

JOB = Job().with_values(levels={"finishing_levels": 1})
DEEP, SHALLOW = (0.0, 1.0), (1.0, 0.0)
"""All of a cut deeper than half its limit, or less deep."""


@pytest.fixture
def levels():
    """Makes three levels that are balls of 10 mm, and a stock, with these shares of the last cut by depth."""
    ball = Capsule(np.zeros(3), np.array([0.0, 0.0, 1e-9]), 10.0).mesh(0.001)
    surface = grooved_pebble(0.2)

    def make(shares, limit=0.5):
        inner = [MorphLevel(k, surface, ball, 0.5, NO_CUT) for k in (1, 2)]
        stock = StockLevel(3, ball, limit, replace(NO_CUT, depth_shares=shares))
        return [PartLevel(surface, ball, NO_CUT), *inner, stock]

    return make


def test_passes_on_a_ball_are_as_long_as_its_area_and_the_step_say(levels):
    job = JOB.with_values(roughing={"radius": 2.0, "scallop": 0.01}, finishing={"radius": 2.0, "scallop": 0.01})
    step = 2 * np.sqrt(0.01 * 3.99)
    on_each = 4 * np.pi * 12**2 / step
    found = estimate(levels(DEEP), job, MachineBodies())
    assert found.length == pytest.approx(LENGTH_FACTOR * 3 * on_each, rel=0.01)
    move = np.sqrt(8 * job.path.chord_tolerance * 12)
    assert found.blocks == pytest.approx(BLOCK_FACTOR * 3 * on_each / move, rel=0.02)


def test_what_is_too_shallow_for_a_roughing_cut_is_left_out(levels):
    job = JOB.with_values(path={"least_depth": 0.1})
    deep = estimate(levels(DEEP, 0.2), job, MachineBodies())
    shallow = estimate(levels(SHALLOW, 0.2), job, MachineBodies())
    half = estimate(levels((0.5, 0.5), 0.2), job, MachineBodies())
    assert shallow.length < deep.length
    assert half.length == pytest.approx((shallow.length + deep.length) / 2)
    assert shallow.blocks < half.blocks < deep.blocks
    assert shallow.minutes < half.minutes < deep.minutes
    for path in ({"least_depth": 0.0}, {"least_depth": 0.1, "pattern": "published"}):
        everywhere = estimate(levels(SHALLOW, 0.2), JOB.with_values(path=path), MachineBodies())
        assert everywhere.length == deep.length


def test_before_levels_the_time_follows_from_the_areas_between_part_and_stock():
    inner, outer = (Capsule(np.zeros(3), np.array([0, 0, 1e-9]), r).mesh(0.001) for r in (10.0, 12.0))
    layers = LayersToCut.between(inner, outer)
    assert layers.distances.max() == pytest.approx(2.0, abs=0.01)
    one = Job().with_values(levels={"depths": "0.1 2"}, roughing={"scallop": 0.3})
    tool, last = one.tool("finishing"), one.tool("roughing")
    steps = [2 * np.sqrt(s * (2 * t.radius - s)) for s, t in ((one.scallop(0), tool), (one.scallop(1), last))]
    first = 4 * np.pi * (10 + tool.radius) ** 2  # the ball's centre runs on the offset surface
    inner_area, outer_area = (4 * np.pi * (r + last.radius) ** 2 for r in (10.0, 12.0))
    middle = inner_area + (outer_area - inner_area) * 0.1 / 2
    evenly = first / steps[0] / tool.feed + middle / steps[1] / last.feed
    assert layers.minutes(one) == pytest.approx(TIME_FACTOR * evenly + 2 * MINUTES_A_LEVEL, rel=0.01)
    finer = one.with_values(levels={"depths": "0.1 0.1 0.1 0.5"})
    assert layers.minutes(finer) > 2 * layers.minutes(one)


def test_a_roughing_cut_leaves_what_the_next_one_takes_off_in_any_case():
    deep = Job(levels={"depths": "0.1 0.25 1", "scallop_share": 0.2})
    assert [least_depth(level, deep) for level in range(5)] == pytest.approx([0.0, 0.0, 0.03, 0.1, 0.1])
    assert [least_depth(level, Job()) for level in (0, 4, 5, 9)] == pytest.approx([0.0, 0.0, 0.03, 0.03])


def test_a_job_may_have_everything_cut():
    everywhere = {"levels": {"depths": "0.1 1", "scallop_share": 0.2}}
    assert least_depth(3, Job(**everywhere, path={"least_depth": 0.0})) == 0.0
    assert least_depth(3, Job(**everywhere, path={"pattern": "published"})) == -math.inf
