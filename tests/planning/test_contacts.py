"""What a covered level promises: no cusp above the scallop, no gouge, no long chord, no contact at the
post.

Which stretches of lines are cut, in which steps, and how they are entered.

What a ball does to a ridge while it moves straight past it, known by hand.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial import KDTree
from small_parts import FINISHING_CUTTER, HOLDING, grooved_pebble, level_of, mesh_of, pebble

from bonecam.errors import ToolPathError
from bonecam.job import HoldingJob, PathJob
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.planning import candidate_contacts, contact_path
from bonecam.planning.contacts import (
    BESIDE,
    BETWEEN_SHARE,
    FLUTE_SHARE,
    LEAST_CONTACTS,
    MESH_SHARE,
    MOVE_SHARE,
    POST_CLEARANCE,
    POSTING_SHARE,
    SHORT_GAP,
    SLOPE,
    USELESS_GAP,
    WORD_ROUNDING,
    DepthLimits,
    Lines,
    cutting_passes,
    gouge_free_lifts,
    moves_gouge_free,
    planned_tolerance,
    useful_passes,
    whole_passes,
)
from bonecam.planning.spacing import MAX_STEP
from bonecam.surface import TSpline
from bonecam.tool import ContactPath
from bonecam.workholding import post_below

PATTERNS = ("round", "along", "iso-scallop", "spiral", "bands")


@cache
def covered(surface: TSpline, pattern: str, post_clearance: float = POST_CLEARANCE) -> ContactPath:
    """Covers a surface with contacts of the finishing cutter, lines running in `pattern`; each way once."""
    level = level_of(surface)
    post = post_below(level.mesh, HOLDING)
    job = PathJob(pattern=pattern)
    return contact_path(
        candidate_contacts(
            level, [MeshDistance(level.mesh)], FINISHING_CUTTER, post, job, post_clearance=post_clearance
        )
    )


def joined(path: ContactPath) -> np.ndarray:
    return np.flatnonzero(path.pass_index[1:] == path.pass_index[:-1])


def swept_centres(path: ContactPath, parts: int = 12) -> np.ndarray:
    i = joined(path)
    return np.vstack([(1 - f) * path.centres[i] + f * path.centres[i + 1] for f in np.linspace(0, 1, parts + 1)])


def heights_left(surface: TSpline, path: ContactPath, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Random surface points and how far along the normal material is left above each, by rays into the
    balls."""
    rng = np.random.default_rng(7)
    s, t = rng.random(count), 0.001 + 0.998 * rng.random(count)
    points, normals = np.asarray(surface.evaluate(s, t)), surface.normals(s, t)
    centres, radius = swept_centres(path), path.cutter.radius
    left = np.full(count, np.inf)
    for i, near in enumerate(KDTree(centres).query_ball_point(points + radius * normals, 0.9 * radius)):
        to = centres[near] - points[i]
        along = to @ normals[i]
        root = radius**2 - (to * to).sum(1) + along**2
        if (root > 0).any():
            left[i] = (along - np.sqrt(np.maximum(root, 0)))[root > 0].min()
    return points, left


@pytest.mark.parametrize("pattern", PATTERNS)
def test_no_cusp_exceeds_the_scallop(pattern):
    surface = pebble()
    path = covered(surface, pattern)
    points, left = heights_left(surface, path, 1500)
    reached = KDTree(path.uncut).query(points)[0] > 0.6
    assert reached.mean() > 0.85
    assert left[reached].max() <= path.cutter.scallop + 1e-3
    assert left[reached].max() >= 0.6 * path.cutter.scallop, "passes lie closer than needed"
    assert left[reached].min() >= -PathJob().gouge_tolerance


@pytest.mark.parametrize("pattern", PATTERNS)
def test_straight_moves_follow_the_offset_curve(pattern):
    surface, job = pebble(), PathJob()
    path = covered(surface, pattern)
    i = joined(path)
    length = np.linalg.norm(path.centres[i + 1] - path.centres[i], axis=1)
    assert length.max() <= MAX_STEP + 1e-9
    assert path.lifts.max() == 0
    for f in (0.25, 0.5, 0.75):
        centres = (1 - f) * path.centres[i] + f * path.centres[i + 1]
        distances = surface.project(centres).distances
        assert np.abs(distances - path.cutter.radius).max() <= 1.25 * job.chord_tolerance


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_ball_never_enters_the_level(pattern):
    surface = grooved_pebble(1.6)
    path = covered(surface, pattern)
    fine = MeshDistance(mesh_of(surface))
    assert path.lifts.max() > path.cutter.scallop, "the groove must be too sharp for the ball, else this proves nothing"
    assert (path.cutter.radius - fine.signed(swept_centres(path, 8))).max() <= PathJob().gouge_tolerance
    assert "gouge" in path.reasons


def test_balls_keep_clear_of_the_post():
    surface = pebble()
    path = covered(surface, "round", post_clearance=0.3)
    post = post_below(mesh_of(surface), HOLDING)
    assert post.distance(path.centres).min() >= path.cutter.radius + 0.3
    assert path.reasons.count("post") > 10


def test_neighbouring_passes_run_opposite_ways():
    path = covered(pebble(), "round")
    i = joined(path)
    round_ = np.cross(path.centres[i], path.centres[i + 1])[:, 2]
    sense = np.array([np.sign(round_[path.pass_index[i] == k].sum()) for k in range(path.pass_index.max() + 1)])
    rings = np.array(
        [np.ptp(path.parameters[path.pass_index == k, 0]) > 0.999 for k in range(path.pass_index.max() + 1)]
    )
    both = rings[1:] & rings[:-1]
    assert both.mean() > 0.8
    assert (sense[1:] == -sense[:-1])[both].all()
    moves = path.centres[i + 1] - path.centres[i]
    assert ((path.feeds[i] * moves).sum(1) > 0).all()


def test_a_post_beside_the_part_is_refused():
    mesh = mesh_of(pebble())
    aside = replace(mesh, vertices=mesh.vertices + np.array([20.0, 0, 0]))
    with pytest.raises(ToolPathError, match="misses"):
        post_below(aside, HoldingJob(diameter=4.0))


def test_the_post_ends_inside_the_part():
    mesh = mesh_of(pebble())
    post = post_below(mesh, HOLDING)
    rim = np.array([[post.radius * np.cos(a), post.radius * np.sin(a), post.top + 0.05] for a in np.linspace(0, 6, 9)])
    assert MeshDistance(mesh).inside(rim).all()


def test_nothing_to_cut_is_an_error():
    with pytest.raises(ToolPathError, match=r"contacts \(\d+\.\d mm2\) are too near the post") as told:
        covered(pebble(), "round", post_clearance=50.0)
    assert told.value.evidence["area_mm2"] == pytest.approx(pebble().area, rel=0.01)


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


TOLERANCE = 0.01


def roof(height: float = 10.0) -> MeshDistance:
    """A prism 20 mm wide whose ridge, along y at z = 0, is a right angle."""
    x, z = np.array([-height, height, 0.0]), np.array([-height, -height, 0.0])
    vertices = np.vstack([np.column_stack([x, np.full(3, y), z]) for y in (-20.0, 20.0)])
    sides = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]]
    return MeshDistance(TriangleMesh(vertices, np.array([[0, 2, 1], [3, 4, 5], *sides], dtype=np.int32)))


@pytest.mark.parametrize(
    ("deep", "free"), [(0.0, True), (0.9 * MOVE_SHARE, True), (1.05 * BETWEEN_SHARE, False), (5.0, False)]
)
@pytest.mark.parametrize("length", [0.1, 4.0])
def test_a_ball_that_passes_over_a_ridge_may_not_enter_it(deep, free, length):
    """Both its ends may be clear of the ridge; the middle is `deep` tolerances in it."""
    z = 1.0 - deep * TOLERANCE
    starts, ends = np.array([[-0.4 * length, 0.0, z]]), np.array([[0.6 * length, 0.3, z]])
    assert moves_gouge_free(starts, ends, 1.0, TOLERANCE, roof()).tolist() == [free]


def test_each_move_is_judged_for_itself():
    """Beside the ridge, over it, onto it, and from it into the part."""
    starts = np.array([[0.0, 0.0, 1.0], [-3.0, 0.0, 1.0], [0.0, 0.0, 3.0], [0.0, 0.0, 1.0]])
    ends = np.array([[3.0, 0.0, 1.0], [3.0, 0.0, 0.5], [0.0, 0.0, 1.0], [0.0, 0.0, -6.0]])
    assert moves_gouge_free(starts, ends, 1.0, TOLERANCE, roof()).tolist() == [True, False, True, False]


def bump(place: float) -> MeshDistance:
    """A block with a flat top at z = 0 and a blunt ridge across it, 0.05 mm high, at x = `place`."""
    x = np.array([-20.0, place - 0.05, place, place + 0.05, 20.0, 20.0, -20.0])
    z = np.array([0.0, 0.0, 0.05, 0.0, 0.0, -10.0, -10.0])
    vertices = np.vstack([np.column_stack([x, np.full(7, y), z]) for y in (-20.0, 20.0)])
    around = [[a, b, c] for i in range(7) for j in [(i + 1) % 7] for a, b, c in ((i, j, j + 7), (i, j + 7, i + 7))]
    cap = [(0, 1, 6), (1, 3, 6), (1, 2, 3), (3, 5, 6), (3, 4, 5)]
    ends = [(c, b, a) for a, b, c in cap] + [(a + 7, b + 7, c + 7) for a, b, c in cap]
    faces = np.array(around + ends, dtype=np.int32)
    mesh = TriangleMesh(vertices, faces)
    return MeshDistance(mesh if mesh.volume > 0 else TriangleMesh(vertices, faces[:, ::-1]))


@pytest.mark.parametrize("place", [0.5, 1.0, 1.25, 2.0, 2.4, 3.9])
def test_a_long_move_is_lifted_over_a_ridge_wherever_it_lies(place):
    contacts, up = np.array([[-5.0, 0.0, 0.0], [5.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
    obstacle = bump(place)
    lifts = gouge_free_lifts(contacts, up, 0.5, TOLERANCE, [obstacle], np.array([True, False]), 0.2)
    centres = contacts + (0.5 + lifts)[:, None] * up
    way = np.linspace(centres[0], centres[1], 2001)
    assert (0.5 - obstacle.signed(way)).max() <= TOLERANCE * BETWEEN_SHARE


def test_a_smaller_tolerance_leaves_room_for_the_rounding_of_words():
    assert planned_tolerance(0.01) == 0.01
    assert max(BETWEEN_SHARE, FLUTE_SHARE) + MESH_SHARE + POSTING_SHARE <= 1.0
    for allowed in (0.002, 0.005, 0.00999):
        planned = planned_tolerance(allowed)
        used = (max(BETWEEN_SHARE, FLUTE_SHARE) + MESH_SHARE + POSTING_SHARE) * planned
        assert 0 < planned <= 0.01
        assert used + WORD_ROUNDING <= allowed * (1 + 1e-9)
