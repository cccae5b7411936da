"""What rest paths promise: no ball of theirs, nor of the level's own path after them, is deeper than allowed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from bonecam.job import PathJob
from bonecam.levels.measure.cut_measures import NO_CUT
from bonecam.levels.measure.level import StockLevel
from bonecam.material.in_process_stock import remove_material, uncut_material
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.passes.contacts import candidate_contacts, contact_path
from bonecam.planning.passes.engaged_segments import UNCERTAIN, DepthLimits
from bonecam.planning.passes.rest_machining import ENTRY, _first, after_steps, rest_contacts, too_deep
from bonecam.setup.capsule import Capsule
from bonecam.tool.path import MoveKind
from bonecam.workholding.post import post_below

LIMIT = 0.15
SCALLOP = 0.03
JOB = PathJob(pattern="round")


class Skin(Capsule):
    """A stock that is 0.3 mm outside every level."""

    def closest_points(self, points):
        return points + 0.3 * self.normals(points)


@pytest.fixture(scope="module")
def cut(path_of):
    """Takes what a path of contacts removes from the material."""

    def take(material, level, contacts):
        up = np.tile([0.0, 0.0, 1.0], (len(contacts.centres), 1))
        tips = contacts.centres - contacts.cutter.radius * up
        kinds = np.full(len(tips), int(MoveKind.CUT))
        path = path_of(tips, up, kinds=kinds, passes=contacts.pass_index, tool=contacts.cutter)
        return remove_material(material, level, path)

    return take


@pytest.fixture(scope="module")
def roughed(roughing_cutter, finishing_cutter, level_of, pebble, mesh_of, upright_capsule, holding, cut):
    """A part, the contacts of a small ball on it, and the material that a large ball has left 0.1 mm outside it:
    deeper than that only round the post, where the large ball left its fillet."""
    part, outer = level_of(pebble()), level_of(pebble(0.1), 1, 0.5)
    levels = [part, outer, StockLevel(2, upright_capsule.mesh(0.01), 0.5, NO_CUT)]
    post = post_below(part.mesh, holding)
    large, small = replace(roughing_cutter, scallop=SCALLOP), replace(finishing_cutter, scallop=SCALLOP)
    capsule = upright_capsule
    material = uncut_material(levels, Skin(capsule.start, capsule.end, capsule.radius))
    roughing = candidate_contacts(outer, [MeshDistance(outer.mesh)], large, post, JOB)
    material = cut(material, outer, contact_path(roughing))
    return part, candidate_contacts(part, [MeshDistance(part.mesh)], small, post, JOB), material


@pytest.fixture(scope="module")
def allowed():
    return DepthLimits(LIMIT, SCALLOP)


@pytest.fixture(scope="module")
def rest(roughed, allowed):
    _, candidates, material = roughed
    return rest_contacts([candidates], material, allowed)


def test_no_ball_of_a_rest_path_is_deeper_than_the_limit(roughed, rest, cut):
    part, _, material = roughed
    assert len(rest) >= 2
    for path in rest:
        depth, _ = material.depths(path.centres, path.cutter.radius)
        assert depth.max() < LIMIT + UNCERTAIN
        assert depth.max() > 0.5 * LIMIT
        material = cut(material, part, path)


def test_after_the_rest_paths_nothing_is_too_deep(roughed, rest, allowed, cut):
    part, candidates, material = roughed
    assert too_deep(candidates, material, allowed)
    for path in rest:
        material = cut(material, part, path)
    assert not too_deep(candidates, material, allowed)
    own = contact_path(candidates, material, allowed)
    assert material.depths(own.centres, own.cutter.radius)[0].max() < allowed.deepest


def test_rest_paths_stay_where_something_is_too_deep(roughed, rest, allowed):
    _, candidates, material = roughed
    deep = candidates.usable & (candidates.depths(material) > allowed.deepest)
    highest = candidates.contacts[deep][:, 2].max()
    assert all(path.contacts[:, 2].max() < highest + 1.0 for path in rest)
    assert sum(len(path.contacts) for path in rest) < len(candidates.contacts)


def test_no_ball_of_a_rest_path_enters_the_part(roughed, rest):
    part, candidates, _ = roughed
    for path in rest:
        joined = np.flatnonzero(path.pass_index[1:] == path.pass_index[:-1])
        for share in (0.0, 0.5):
            places = (1 - share) * path.centres[joined] + share * path.centres[joined + 1]
            free = MeshDistance(part.mesh).signed(places) - path.cutter.radius
            assert free.min() > -candidates.gouge_tolerance


def test_a_turn_that_takes_longer_than_the_way_counts(roughed, allowed):
    """Rings round the part: a whole turn each, however short they are."""
    _, candidates, material = roughed
    step = _first(candidates, material, allowed)
    fast = step.minutes(np.inf)
    ways = sum(np.linalg.norm(np.diff(candidates.centres[run], axis=0), axis=1).sum() for run in step.runs)
    assert fast == pytest.approx(ways / candidates.cutter.feed + ENTRY * len(step.runs), rel=0.1)
    steps = np.concatenate([np.abs(np.diff(candidates.parameters[run, 0])) for run in step.runs])
    assert steps.max() > 0.5, "a run goes on behind the seam"
    turns = np.minimum(steps, 1 - steps).sum()
    slow = 0.001
    assert step.minutes(slow) == pytest.approx(2 * np.pi * turns / slow, rel=0.1)


def test_the_pattern_that_takes_less_time_is_taken(roughed, allowed, holding):
    """Rings are short, but turn; lines along the part hardly turn."""
    part, rings, material = roughed
    post = post_below(part.mesh, holding)
    obstacles = [MeshDistance(part.mesh)]
    lines = candidate_contacts(part, obstacles, rings.cutter, post, PathJob(pattern="along"))
    patterns = [lines, rings]
    for speed in (np.inf, 0.01):
        minutes = [_first(one, material, allowed).minutes(speed) for one in patterns]
        soonest = patterns[int(np.argmin(minutes))]
        taken = rest_contacts(patterns, material, allowed, speed)[0]
        away, _ = KDTree(soonest.contacts).query(taken.contacts)
        assert away.max() < 1e-9
    assert np.argmin(minutes) == 0


def test_rest_paths_are_numbered_and_begin_in_air(roughed, rest):
    _, _, material = roughed
    assert [path.rest for path in rest] == list(range(1, len(rest) + 1))
    begins = np.r_[0, np.flatnonzero(np.diff(rest[0].pass_index)) + 1]
    depth, _ = material.depths(rest[0].centres[begins], rest[0].cutter.radius)
    assert depth.max() < 0.3 * LIMIT


def test_where_a_step_was_left_out_the_steps_and_the_passes_after_it_are_too(roughed, rest, allowed, cut):
    part, candidates, material = roughed
    begun = cut(material, part, rest[0])
    whole = after_steps(rest[1], begun, allowed)
    assert np.array_equal(whole.centres, rest[1].centres)
    assert np.array_equal(whole.pass_index, rest[1].pass_index)
    last = after_steps(rest[-1], material, allowed)
    assert 0 < len(last.contacts) < len(rest[-1].contacts)
    assert material.depths(last.centres, last.cutter.radius)[0].max() <= allowed.deepest
    index = [np.flatnonzero((rest[-1].centres == centre).all(axis=1))[0] for centre in last.centres]
    same = np.diff(last.pass_index) == 0
    assert (np.diff(index)[same] == 1).all()
    own = contact_path(candidates, material, allowed, allowed.deepest)
    assert material.depths(own.centres, own.cutter.radius)[0].max() <= allowed.deepest
    assert own.reasons.count("covered") > contact_path(candidates, material, allowed).reasons.count("covered")


def test_a_pass_ends_before_a_ridge_that_its_ball_would_cut_through(roughed, rest, allowed):
    _, _, material = roughed
    contacts = rest[0].take(np.flatnonzero(rest[0].pass_index == rest[0].pass_index[0]))
    opposite = np.argmax(np.linalg.norm(contacts.centres - contacts.centres[0], axis=1))
    across = contacts.take(np.array([0, 1, opposite]))
    assert material.depths(across.centres, across.cutter.radius)[0].max() < allowed.deepest
    assert after_steps(across, material, allowed).pass_index.tolist() == [0, 0, 1]


def test_there_is_no_rest_where_nothing_is_too_deep(roughed):
    _, candidates, material = roughed
    assert rest_contacts([candidates], material, DepthLimits(1.0)) == []
