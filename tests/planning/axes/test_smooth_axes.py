"""What smooth axes promise: bounds, smoothness, and cones kept."""

from dataclasses import replace

import numpy as np
import pytest
from deepest_entry import deepest_entry
from small_lump import lump
from small_parts import level_of

from bonecam.arrays import dots
from bonecam.job import NcJob, PathJob
from bonecam.machine import MachineLimits
from bonecam.machine.limits import polar_angles
from bonecam.planning import Scene, admissible_cones, orient
from bonecam.planning.axes.field import (
    ALONG,
    AROUND,
    SLOW,
    AxisField,
    FieldDomain,
    SmoothAxes,
    contact_facets,
    level_axes,
    machine_minutes,
    rotary_travel,
    smooth_axes,
    soonest,
)
from bonecam.planning.axes.lead import lead_axes
from bonecam.surface import TSpline
from bonecam.tool import ContactPath, MoveKind
from bonecam.workholding import Clamping
from bonecam.workholding.post import Column

pytestmark = pytest.mark.whole


LIMITS = MachineLimits(np.radians(115.0), tilt_speed=np.radians(90) * 60, turn_speed=np.radians(120) * 60)
JOB = PathJob(pattern="along", orientation="cones")

NEAR = Clamping(clearance=0.5)
"""Holders may come near the post: the part is what they meet."""

Made = tuple[TSpline, ContactPath, Scene]


def smoothed(
    made: Made, job: PathJob = JOB, start: AxisField | None = None, limits: MachineLimits = LIMITS
) -> SmoothAxes:
    surface, contacts, scene = made
    cones = admissible_cones(contacts, scene, limits, job)
    facets = contact_facets(contacts, surface)
    return smooth_axes(cones, FieldDomain.of(surface), limits, job, start, facets=facets)


@pytest.fixture(scope="module")
def case():
    return lump(JOB, NEAR)


@pytest.fixture(scope="module")
def smooth(case):
    return smoothed(case)


def on_lines(contacts: ContactPath) -> np.ndarray:
    """Which contacts lie on passes along the part: not on the ring round the post."""
    s = contacts.parameters[:, 0]
    spread = [np.ptp(s[contacts.pass_index == number]) for number in contacts.pass_index]
    return np.array(spread) < 1e-9


def rates(contacts: ContactPath, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turn of the slower rotary axis over each move of a pass along the part, as a share of what it can at the
    feed; and the time of the move at the feed. In the groove the ball moves by a hundredth of a millimetre here and
    there."""
    same = (contacts.pass_index[1:] == contacts.pass_index[:-1]) & on_lines(contacts)[1:]
    azimuth = np.arctan2(axes[:, 1], axes[:, 0])
    turn = np.abs(np.angle(np.exp(1j * np.diff(azimuth)))) / LIMITS.turn_speed
    tilt = np.abs(np.diff(polar_angles(axes))) / LIMITS.tilt_speed
    time = np.linalg.norm(np.diff(contacts.centres, axis=0), axis=1) / contacts.cutter.feed
    return (np.maximum(turn, tilt) / np.maximum(time, 1e-9))[same], time[same]


def test_the_field_keeps_its_bounds(case, smooth):
    axes, normals = smooth.axes, case[1].normals
    tilt = np.degrees(np.arccos(dots(axes, normals)))
    assert tilt.max() < JOB.max_tilt_deg
    assert np.mean(tilt[on_lines(case[1])] < JOB.least_lead_deg - 1) < 0.03
    assert polar_angles(axes).max() < LIMITS.largest


def test_the_machine_follows_the_field_at_the_feed(case, smooth):
    contacts = case[1]
    asked, time = rates(contacts, smooth.axes)
    lead, _ = rates(contacts, lead_axes(contacts.normals, contacts.feeds, np.radians(10.0)))
    assert np.average(asked > 1, weights=time) < 0.01
    assert np.average(lead > 1, weights=time) > 0.2
    assert np.average(np.maximum(asked, 1), weights=time) < 1.02


def test_axes_that_collide_are_led_into_cones():
    """From a field that points down, through a chuck below the part."""
    case = lump(JOB, Clamping((Column(14.0, 25.0),), clearance=4.0))
    surface, contacts, scene = case
    flat = np.zeros(AROUND * ALONG)
    start = AxisField(FieldDomain.of(surface), 1, flat, flat + np.radians(112.0))
    smooth = smoothed(case, start=start)
    some = np.flatnonzero(smooth.cones.found)[::5]
    hits = [
        np.mean(deepest_entry(scene, contacts.cutter, contacts.centres[some], axes[some]) > 0.011)
        for axes in (smooth.axes, start.axes(contacts.parameters))
    ]
    assert hits[0] == 0
    assert hits[1] > 0.5
    assert smooth.wanted.certified[smooth.cones.found].mean() > 0.97


def test_the_oriented_path_takes_the_axes_of_the_field_where_no_rotary_axis_holds_it_up(case, smooth):
    _, contacts, scene = case
    wanted = smooth.axes
    fast = replace(LIMITS, tilt_speed=np.inf, turn_speed=np.inf)
    for limits in (fast, LIMITS):
        path = orient(contacts, scene, limits, JOB, NcJob(), smooth.wanted)
        cut = path.kinds == MoveKind.CUT
        nearest = np.linalg.norm(path.contacts[cut][:, None] - contacts.contacts[None], axis=2).argmin(axis=1)
        taken = np.linalg.norm(path.axes[cut] - wanted[nearest], axis=1) < 1e-9
        assert taken.mean() > (0.9 if limits is fast else 0.7)
        cones = smooth.wanted.cones
        assert cones is not None
        shapes = cones.shapes.take(cones.cone_of[nearest])
        inside = shapes.off(path.axes[cut]) < shapes.mean_angles + 1e-9
        assert inside[smooth.wanted.certified[nearest]].mean() > 0.99


def test_a_path_of_which_no_contact_is_left_has_no_axes(case, smooth):
    """Rest paths may have left nothing for a level's own passes."""
    nothing = case[1].take(np.zeros(0, dtype=np.int64))
    assert smooth.wanted_for(nothing).axes.shape == (0, 3)


def test_a_neighbours_field_is_a_start_that_leads_to_the_same_smoothness(case, smooth):
    again = smoothed(case, start=smooth.field)
    (one, time), (other, _) = (rates(case[1], found.axes) for found in (smooth, again))
    one, other = (np.sqrt(np.average(rate**2, weights=time)) for rate in (one, other))
    assert other < 1.05 * one


def test_axes_that_a_neighbours_field_would_make_slow_are_sought_anew(case):
    """From a field that turns against the normals, on a machine whose rotary axes are slow."""
    surface, contacts, scene = case
    limits = replace(LIMITS, tilt_speed=LIMITS.tilt_speed / 3, turn_speed=LIMITS.turn_speed / 3)
    alone = smoothed(case, limits=limits)
    against = AxisField(alone.field.domain, -1, alone.field.azimuth, alone.field.polar)
    misled = smoothed(case, start=against, limits=limits)
    anew = level_axes(contacts, level_of(surface), scene, limits, JOB, misled)
    assert anew is not None
    minutes = [machine_minutes(contacts, one.axes, limits) for one in (misled, anew, alone)]
    assert minutes[0] > SLOW * minutes[2]
    assert minutes[1] == minutes[2]


def test_where_no_contact_has_a_cone_the_axes_of_the_level_before_stay(smooth):
    surface, contacts, scene = lump(JOB, Clamping((Column(50.0, 200.0),)))
    for before in (None, smooth):
        assert level_axes(contacts, level_of(surface), scene, LIMITS, JOB, before) is before


def test_where_no_contact_has_a_cone_no_axis_is_certified(case):
    """Contacts 0.3 mm inside the part."""
    surface, contacts, scene = case
    some = contacts.take(np.arange(0, len(contacts.centres), 20))
    inside = replace(some, centres=some.centres - (some.cutter.radius + 0.3) * some.normals)
    made = smoothed((surface, inside, scene))
    assert np.isfinite(made.axes).all()
    assert not made.wanted.certified.any()


def test_verified_cones_keep_the_word_of_fcl(case, smooth):
    some = np.arange(len(smooth.cones.shapes)) % 40 == 0
    few = replace(smooth, cones=replace(smooth.cones, shapes=smooth.cones.shapes.scaled(np.where(some, 1.0, -1.0))))
    assert few.wanted.cones.check is None
    check = few.verified(case[2]).wanted.cones.check
    assert check.asked == few.cones.shapes.found.sum() > 0
    assert check.narrowed + check.refused <= 0.05 * check.asked


def test_the_cones_of_a_level_are_put_before_fcl_unless_the_job_says_no(case):
    surface, contacts, scene = case
    some = contacts.take(np.arange(0, len(contacts.centres), 8))
    for certify, asked in (("automatic", True), ("fcl", True), ("distances", False)):
        job = replace(JOB, certify=certify)
        made = level_axes(some, level_of(surface), scene, LIMITS, job, None)
        assert made is not None
        assert (made.cones.check is not None) == asked


def test_a_field_made_for_more_than_the_feed_turns_less(case, smooth):
    contacts = case[1]
    smoother = smooth_axes(smooth.cones, smooth.field.domain, LIMITS, JOB, haste=5.0)
    assert rotary_travel(contacts, smoother.axes) < rotary_travel(contacts, smooth.axes)


def test_of_axes_that_are_as_soon_those_that_turn_less_are_taken(smooth):
    axes = smooth.axes + 1e-4 * np.random.default_rng(1).normal(size=smooth.axes.shape)
    trembling = replace(smooth, axes=axes / np.linalg.norm(axes, axis=1)[:, None])
    assert soonest([trembling, smooth], LIMITS) is smooth
