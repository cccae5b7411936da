"""What rest paths promise: no ball of theirs, nor of the level's own path after them, is deeper than allowed; they are
cut from as few directions as reach them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import KDTree
from small_parts import FINISHING_CUTTER, HOLDING, ROUGHING_CUTTER, UPRIGHT_CAPSULE, level_of, path_of, pebble

from bonecam.arrays import angles_between
from bonecam.job import PathJob
from bonecam.levels import StockLevel
from bonecam.levels.measure import NO_CUT
from bonecam.machine.limits import MachineLimits
from bonecam.material import remove_material, uncut_material
from bonecam.mesh import MeshDistance
from bonecam.planning import candidate_contacts, contact_path
from bonecam.planning.axes.tool_axes import WantedAxes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.contacts import UNCERTAIN, DepthLimits
from bonecam.planning.rest_machining import ENTRY, RestMachining, _step, after_steps, held_axes, too_deep
from bonecam.setup import Capsule
from bonecam.tool import MoveKind
from bonecam.tool.path import ContactPath
from bonecam.workholding import Clamping, post_below

LIMIT = 0.11
SCALLOP = 0.03
JOB = PathJob(pattern="round")


class Skin(Capsule):
    """A stock that is 0.3 mm outside every level."""

    def closest_points(self, points):
        return points + 0.3 * self.normals(points)


def cut(material, level, contacts):
    """Takes what a path of contacts removes from the material."""
    up = np.tile([0.0, 0.0, 1.0], (len(contacts.centres), 1))
    tips = contacts.centres - contacts.cutter.radius * up
    kinds = np.full(len(tips), int(MoveKind.CUT))
    path = path_of(tips, up, kinds=kinds, passes=contacts.pass_index, tool=contacts.cutter)
    return remove_material(material, level, path)


@pytest.fixture(scope="module")
def roughed():
    """A part, the contacts of a small ball on it, and the material that a large ball has left 0.1 mm outside it:
    deeper than that only round the post, where the large ball left its fillet."""
    part, outer = level_of(pebble()), level_of(pebble(0.1), 1, 0.5)
    levels = [part, outer, StockLevel(2, UPRIGHT_CAPSULE.mesh(0.01), 0.5, NO_CUT)]
    post = post_below(part.mesh, HOLDING)
    large, small = replace(ROUGHING_CUTTER, scallop=SCALLOP), replace(FINISHING_CUTTER, scallop=SCALLOP)
    capsule = UPRIGHT_CAPSULE
    material = uncut_material(levels, Skin(capsule.start, capsule.end, capsule.radius))
    roughing = candidate_contacts(outer, [MeshDistance(outer.mesh)], large, post, JOB)
    material = cut(material, outer, contact_path(roughing))
    return part, candidate_contacts(part, [MeshDistance(part.mesh)], small, post, JOB), material


ALLOWED = DepthLimits(LIMIT, SCALLOP)


@pytest.fixture(scope="module")
def rest(roughed):
    """The steps of a level, each with the material before it."""
    part, candidates, material = roughed
    return steps_of(RestMachining([candidates], ALLOWED), material, lambda *now: cut(now[0], part, now[1]))


def steps_of(machining, material, cut):
    steps = []
    while (path := machining.contacts(material)) is not None:
        steps.append((path, material))
        material = cut(material, path)
    return steps


def step_of(candidates, material, allowed):
    depth = candidates.depths(material)
    return _step(candidates, material, allowed, depth, np.ones(len(depth), dtype=bool))


def test_no_ball_of_a_rest_path_is_deeper_than_its_step(rest):
    assert len(rest) >= 2
    for path, material in rest:
        depth, _ = material.depths(path.centres, path.cutter.radius)
        assert depth.max() < LIMIT + UNCERTAIN
        assert depth.max() > 0.5 * LIMIT


def test_deeper_steps_are_fewer_and_leave_the_cut_of_the_level(roughed, rest):
    part, candidates, material = roughed
    deeper = replace(ALLOWED, step=2 * LIMIT)
    steps = steps_of(RestMachining([candidates], deeper), material, lambda *now: cut(now[0], part, now[1]))
    assert 0 < len(steps) < len(rest)
    path, before = steps[0]
    assert LIMIT + UNCERTAIN < before.depths(path.centres, path.cutter.radius)[0].max() < 2 * LIMIT + UNCERTAIN
    path, before = steps[-1]
    after = cut(before, part, path)
    assert not too_deep(candidates, after, ALLOWED)
    deep = candidates.usable & (candidates.depths(before) > deeper.deepest)
    assert (candidates.depths(after)[deep] > 0.3 * LIMIT).all(), "the level's own cut is not taken before it"


def test_what_no_step_brings_nearer_is_not_asked_again(roughed):
    _, candidates, material = roughed
    machining = RestMachining([candidates], ALLOWED)
    assert machining.contacts(material) is not None
    assert machining.contacts(material) is None


def test_after_the_rest_paths_nothing_is_too_deep(roughed, rest):
    part, candidates, material = roughed
    assert too_deep(candidates, material, ALLOWED)
    path, before = rest[-1]
    material = cut(before, part, path)
    assert not too_deep(candidates, material, ALLOWED)
    own = contact_path(candidates, material, ALLOWED)
    assert material.depths(own.centres, own.cutter.radius)[0].max() < ALLOWED.deepest


def test_rest_paths_stay_where_something_is_too_deep(roughed, rest):
    _, candidates, material = roughed
    deep = candidates.usable & (candidates.depths(material) > ALLOWED.deepest)
    highest = candidates.contacts[deep][:, 2].max()
    assert all(path.contacts[:, 2].max() < highest + 1.0 for path, _ in rest)
    assert sum(len(path.contacts) for path, _ in rest) < len(candidates.contacts)


def test_no_ball_of_a_rest_path_enters_the_part(roughed, rest):
    part, candidates, _ = roughed
    for path, _ in rest:
        joined = np.flatnonzero(path.pass_index[1:] == path.pass_index[:-1])
        for share in (0.0, 0.5):
            places = (1 - share) * path.centres[joined] + share * path.centres[joined + 1]
            free = MeshDistance(part.mesh).signed(places) - path.cutter.radius
            assert free.min() > -candidates.gouge_tolerance


def test_a_turn_that_takes_longer_than_the_way_counts(roughed):
    """Rings round the part: a whole turn each, however short they are."""
    _, candidates, material = roughed
    step = step_of(candidates, material, ALLOWED)
    fast = step.minutes(np.inf)
    ways = sum(np.linalg.norm(np.diff(candidates.centres[run], axis=0), axis=1).sum() for run in step.runs)
    assert fast == pytest.approx(ways / candidates.cutter.feed + ENTRY * len(step.runs), rel=0.1)
    steps = np.concatenate([np.abs(np.diff(candidates.parameters[run, 0])) for run in step.runs])
    assert steps.max() > 0.5, "a run goes on behind the seam"
    turns = np.minimum(steps, 1 - steps).sum()
    slow = 0.001
    assert step.minutes(slow) == pytest.approx(2 * np.pi * turns / slow, rel=0.1)


def test_the_pattern_that_takes_less_time_is_taken(roughed):
    """Rings are short, but turn; lines along the part hardly turn."""
    part, rings, material = roughed
    post = post_below(part.mesh, HOLDING)
    obstacles = [MeshDistance(part.mesh)]
    lines = candidate_contacts(part, obstacles, rings.cutter, post, PathJob(pattern="along"))
    patterns = [lines, rings]
    for speed in (np.inf, 0.01):
        minutes = [step_of(one, material, ALLOWED).minutes(speed) for one in patterns]
        soonest = patterns[int(np.argmin(minutes))]
        taken = RestMachining(patterns, ALLOWED, speed).contacts(material)
        away, _ = KDTree(soonest.contacts).query(taken.contacts)
        assert away.max() < 1e-9
    assert np.argmin(minutes) == 0


def test_rest_paths_are_numbered_and_begin_in_air(rest):
    assert [path.rest for path, _ in rest] == list(range(1, len(rest) + 1))
    path, material = rest[0]
    begins = np.r_[0, np.flatnonzero(np.diff(path.pass_index)) + 1]
    depth, _ = material.depths(path.centres[begins], path.cutter.radius)
    assert depth.max() < 0.3 * LIMIT


def test_where_a_step_is_too_deep_it_is_left_out_and_so_are_the_passes_after_it(roughed, rest):
    _, candidates, material = roughed
    path, before = rest[1]
    whole = after_steps(path, before, ALLOWED)
    assert np.array_equal(whole.centres, path.centres)
    assert np.array_equal(whole.pass_index, path.pass_index)
    path, _ = rest[-1]
    last = after_steps(path, material, ALLOWED)
    assert 0 < len(last.contacts) < len(path.contacts)
    assert material.depths(last.centres, last.cutter.radius)[0].max() <= ALLOWED.deepest
    index = [np.flatnonzero((path.centres == centre).all(axis=1))[0] for centre in last.centres]
    same = np.diff(last.pass_index) == 0
    assert (np.diff(index)[same] == 1).all()
    own = contact_path(candidates, material, ALLOWED, ALLOWED.deepest)
    assert material.depths(own.centres, own.cutter.radius)[0].max() <= ALLOWED.deepest
    assert own.reasons.count("covered") > contact_path(candidates, material, ALLOWED).reasons.count("covered")


def test_a_pass_ends_before_a_ridge_that_its_ball_would_cut_through(rest):
    path, material = rest[0]
    opposite = np.argmax(np.linalg.norm(path.centres - path.centres[0], axis=1))
    across = replace(path.take(np.array([0, 1, opposite])), pass_index=np.zeros(3, dtype=np.int64))
    assert material.depths(across.centres, across.cutter.radius)[0].max() < ALLOWED.deepest
    assert after_steps(across, material, ALLOWED).pass_index.tolist() == [0, 0, 1]


def test_there_is_no_rest_where_nothing_is_too_deep(roughed):
    _, candidates, material = roughed
    assert RestMachining([candidates], DepthLimits(1.0)).contacts(material) is None


LIMITS = MachineLimits(np.radians(100.0), tilt_speed=100.0, turn_speed=100.0)
COUNT = 5
"""Contacts of a pass up a cylinder."""


class Below(CollisionChecker):
    """The tool is free but where its ball is beyond a height, mm."""

    def __init__(self, highest=np.inf):
        scene = SimpleNamespace(clamping=Clamping((), closed=False, clearance=1.0))
        for name, value in (("cutter", ROUGHING_CUTTER), ("scene", scene), ("highest", highest)):
            object.__setattr__(self, name, value)

    def free_by_distance(self, centres, axes):
        return centres[:, 2] < vars(self)["highest"]


def four_passes():
    """Passes up a cylinder about z, by turns on its two sides, each two at 20 degrees from another; and axes that lean
    forward by an angle that grows along each."""
    azimuths = np.radians([0, 180, 20, 200])
    normals = np.repeat(np.column_stack([np.cos(azimuths), np.sin(azimuths), 0 * azimuths]), COUNT, axis=0)
    heights = np.tile(50.0 + 0.5 * np.arange(COUNT), 4)
    contacts = 5 * normals + heights[:, None] * [0, 0, 1]
    flags = np.zeros(len(contacts), dtype=bool)
    up = np.tile([0.0, 0.0, 1.0], (len(contacts), 1))
    centres, passes = contacts + ROUGHING_CUTTER.radius * normals, np.repeat(np.arange(4), COUNT)
    path = ContactPath(
        *(0, ROUGHING_CUTTER, passes, contacts[:, :2], contacts, normals, up, centres, 0.0 * heights, flags),
        *(np.zeros((0, 3)), ()),
        rest=1,
    )
    leads = np.radians(np.tile(15.0 + 5 * np.arange(COUNT), 4))[:, None]
    return path, WantedAxes(np.cos(leads) * normals + np.sin(leads) * up, ~flags)


def test_each_side_is_cut_from_one_direction_and_then_the_other():
    path, wanted = four_passes()
    held, axes = held_axes(path, wanted, Below(), LIMITS, PathJob())
    tilts = np.degrees(angles_between(axes.axes, held.normals))
    assert tilts.min() >= PathJob().least_lead_deg - 1e-6
    assert tilts.max() <= PathJob().max_tilt_deg + 1e-6
    assert len(np.unique(axes.axes, axis=0)) == 2
    assert (np.diff(axes.axes, axis=0) != 0).any(axis=1).sum() == 1
    # the same passes, whole, in another order
    assert (held.pass_index == path.pass_index).all()
    assert sorted(map(tuple, held.contacts)) == sorted(map(tuple, path.contacts))
    assert (np.diff(held.contacts[:, 2])[np.diff(held.pass_index) == 0] > 0).all()
    assert not axes.certified.any()


def test_a_pass_that_no_direction_reaches_keeps_its_axes():
    path, wanted = four_passes()
    third = path.pass_index == 2
    raised = replace(path, centres=path.centres + 100.0 * third[:, None] * [0, 0, 1])
    held, axes = held_axes(raised, wanted, Below(100.0), LIMITS, PathJob())
    kept = held.centres[:, 2] > 100.0
    np.testing.assert_array_equal(axes.axes[kept], wanted.axes[third])
    assert axes.certified[kept].all()
    assert not axes.certified[~kept].any()
    assert len(np.unique(axes.axes[~kept], axis=0)) == 2


def test_a_machine_that_has_few_axes_keeps_them():
    path, wanted = four_passes()
    narrow = MachineLimits(np.radians(90.0), np.radians(90.0))
    held, axes = held_axes(path, wanted, Below(), narrow, PathJob())
    assert held is path
    assert axes is wanted


def test_a_step_all_of_whose_contacts_are_left_out_holds_no_axes():
    """Of the half phalanx: each contact of a step would have cut too deep."""
    path, wanted = four_passes()
    none = np.zeros(0, dtype=np.int64)
    nothing, no_axes = path.take(none), WantedAxes(wanted.axes[none], wanted.certified[none])
    held, axes = held_axes(nothing, no_axes, Below(), LIMITS, PathJob())
    assert held is nothing
    assert axes is no_axes
