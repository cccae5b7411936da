"""Which stretches of lines are cut, in which steps, and how they are entered."""

import numpy as np
import pytest

from bonecam.planning.contacts import (
    BESIDE,
    LEAST_CONTACTS,
    SHORT_GAP,
    SLOPE,
    USELESS_GAP,
    DepthLimits,
    Lines,
    cutting_passes,
    useful_passes,
    whole_passes,
)

STEP = 0.5
UP = np.array([0.0, 0.0, 1.0])


def plane(count=120, rows=1):
    """Straight lines of contacts 0.5 mm apart on a plane, the lines 1 mm apart."""
    x, line = np.tile(STEP * np.arange(count), rows), np.repeat(np.arange(rows), count)
    centres = np.column_stack([x, 1.0 * line, np.zeros(len(x))])
    return Lines(line, centres, np.tile(UP, (len(x), 1)))


def ring(count=80, radius=5.0):
    angle = np.linspace(0, 2 * np.pi, count + 1)
    centres = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count + 1)])
    return Lines(np.zeros(count + 1, dtype=int), centres, np.tile(UP, (count + 1, 1)))


def passes(lines, depth, allowed, usable=None, in_air=False):
    usable = np.ones(len(lines.line), dtype=bool) if usable is None else usable
    return cutting_passes(lines, usable, depth, allowed, np.broadcast_to(in_air, len(depth)))


def test_all_that_is_usable_is_cut_where_nothing_is_asked():
    lines = plane()
    usable = np.ones(120, dtype=bool)
    usable[40:50] = False
    made = whole_passes(lines, usable)
    assert np.array_equal(made.index, np.flatnonzero(usable))
    assert len(np.unique(made.passes)) == 2


def test_what_would_only_rub_is_left_out_with_gaps_worth_a_retract():
    lines = plane()
    depth = np.full(120, 0.2)
    depth[20:70] = 0.01
    depth[90:96] = 0.01
    made = passes(lines, depth, DepthLimits(0.5, least=0.03))
    left = np.setdiff1d(np.arange(120), made.index)
    assert np.array_equal(left, np.arange(20 + BESIDE, 70 - BESIDE))
    assert 6 * STEP < SHORT_GAP < 50 * STEP


def test_a_strip_of_two_contacts_between_air_is_cut_from_air_to_air():
    in_air = np.ones(120, dtype=bool)
    in_air[50:52] = False
    made = passes(plane(), np.where(in_air, -0.1, 0.4), DepthLimits(0.5, least=0.03), ~in_air, in_air)
    assert np.array_equal(made.index, np.arange(50 - BESIDE, 52 + BESIDE))
    assert not made.raised.any()
    assert not len(made.short)


def test_passes_are_left_where_they_are_of_no_use_behind_others():
    useful = np.zeros(120, dtype=bool)
    useful[10:40] = useful[44:70] = useful[90:91] = True
    everywhere = np.ones(120, dtype=bool)
    made = useful_passes(plane(), useful, everywhere, np.full(120, 0.02), DepthLimits(0.5, least=0.03))
    # a gap of 2 mm is cut through; one contact is no pass: it takes those beside it
    wanted = np.r_[np.arange(10, 70), np.arange(90 - BESIDE, 91 + BESIDE)]
    assert np.array_equal(made.index, wanted)
    assert 5 * STEP < USELESS_GAP < 20 * STEP


def test_nothing_deeper_than_the_least_depth_is_left_out():
    rng = np.random.default_rng(3)
    lines = plane(400, 3)
    depth = np.abs(rng.normal(0, 0.05, 1200))
    made = passes(lines, depth, DepthLimits(0.5, least=0.03))
    left = np.setdiff1d(np.arange(1200), made.index)
    assert not np.any(depth[np.setdiff1d(left, made.short)] >= 0.03)


def test_a_pass_that_begins_in_material_is_entered_on_a_ramp():
    lines = plane()
    made = passes(lines, np.full(120, 0.4), DepthLimits(0.5))
    heights = made.raised[:, 2]
    assert heights[0] == pytest.approx(0.4)
    ramp = int(np.argmax(heights == 0))
    run = np.abs(np.diff(lines.centres[made.index[: ramp + 1], 0])).sum()
    assert 0.4 / run <= SLOPE
    assert made.index[ramp] == 0
    assert np.array_equal(made.index[ramp:], np.arange(120))


def test_a_whole_ring_is_entered_along_its_end():
    lines = ring()
    made = passes(lines, np.full(81, 0.4), DepthLimits(0.5))
    ramp = int(np.argmax(made.raised[:, 2] == 0))
    assert np.array_equal(made.index[ramp:], np.arange(81))
    assert np.array_equal(made.index[:ramp], np.arange(80 - ramp, 80))
    assert np.all(np.diff(made.raised[: ramp + 1, 2]) < 0)


def test_no_ramp_where_the_pass_begins_in_air():
    depth = np.full(120, 0.4)
    depth[:5] = 0.0
    assert not passes(plane(), depth, DepthLimits(0.5)).raised.any()


def test_runs_too_short_for_a_plunge_are_told():
    usable = np.zeros(120, dtype=bool)
    usable[10:60] = True
    usable[80 : 80 + LEAST_CONTACTS - 1] = True
    made = passes(plane(), np.full(120, 0.2), DepthLimits(0.5), usable=usable)
    assert np.array_equal(made.short, np.arange(80, 80 + LEAST_CONTACTS - 1))
    assert not np.isin(made.short, made.index).any()


def test_islands_are_cut_one_after_the_other():
    lines = plane(120, 6)
    depth = np.where((lines.centres[:, 0] < 10) | (lines.centres[:, 0] > 45), 0.2, 0.0)
    made = passes(lines, depth, DepthLimits(0.5, least=0.03))
    firsts = np.flatnonzero(np.r_[True, np.diff(made.passes) > 0])
    right = lines.centres[made.index[firsts], 0] > 25
    assert len(firsts) == 12
    assert np.count_nonzero(np.diff(right.astype(int))) == 1


def test_lines_that_meet_at_a_pole_are_cut_side_by_side():
    """Else each would begin in full material across the pole, and the last ones find cusps only."""
    count = 24
    angle, height = np.meshgrid(2 * np.pi * np.arange(count) / count, np.linspace(0.05, 1, 20), indexing="ij")
    height[1::2] = height[1::2, ::-1]  # to and fro
    centres = np.column_stack([(12 * height * f(angle)).ravel() for f in (np.cos, np.sin)] + [np.zeros(angle.size)])
    lines = Lines(np.repeat(np.arange(count), 20), centres, np.tile(UP, (len(centres), 1)))
    away = np.linalg.norm(centres, axis=1)
    near_pole = np.isin(lines.line % 3, (1, 2)) & (away > 2) & (away < 4)
    made = passes(lines, np.full(len(centres), 0.02), DepthLimits(0.5), ~near_pole)
    whole = np.flatnonzero(np.bincount(made.passes) > 8)
    followed = [lines.line[made.index[made.passes == k][0]] for k in whole]
    assert followed == list(range(count))
