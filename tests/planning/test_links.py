"""Lifts within a path for rewinds: there and back without collision, and nothing else changes.

Arcs on which the ball comes onto a cut and leaves it, on a floor with a wall at its end.

Runs of contacts that are linked one after the other.

Where the tool steps over from one pass to the next on the surface.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from boxes import boxes
from jaxtyping import Float
from numpy import ndarray
from small_lump import lump
from small_parts import HOLDING, ROUGHING_CUTTER, UPRIGHT_CAPSULE, grooved_pebble, mesh_of

from bonecam.arrays import angles_between, unit
from bonecam.errors import MachineError
from bonecam.job import NcJob, PathJob
from bonecam.machine import MachineLimits
from bonecam.machine.bodies import Frustum
from bonecam.mesh import MeshDistance
from bonecam.planning import Scene, links, orient
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.layers import HeightMesh
from bonecam.planning.link_space import Feeds, LinkSpace, Pose
from bonecam.planning.links import (
    ARC_STEPS,
    arcs_from,
    arcs_to,
    begins_tangentially,
    find_leads,
    led_links,
    link_runs,
    steps_over,
)
from bonecam.setup import smallest_capsule
from bonecam.surface import TSpline
from bonecam.tool import Cutter, MoveKind, ToolPath
from bonecam.workholding import Clamping, Post, post_below


@pytest.fixture(scope="module")
def made():
    """A path over a lump, its scene, and what makes it anew with lifts."""
    job = PathJob(pattern="round")
    _, contacts, scene = lump(job, Clamping(), ROUGHING_CUTTER, 0.8)

    def oriented(rows):
        return orient(contacts, scene, MachineLimits(np.radians(115.0), lift_places=rows), job, NcJob())

    return oriented(None), scene, oriented


def at(axes: np.ndarray, *rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows as places to lift the path from."""
    places = np.array(rows, dtype=np.float64)
    return places, axes[places.astype(np.int64)]


def cuts_in_a_row(path: ToolPath) -> np.ndarray:
    """Rows that cut, between rows that cut."""
    cut = path.kinds == MoveKind.CUT
    return np.flatnonzero(cut & np.r_[False, cut[:-1]] & np.r_[cut[1:], False])


def test_between_two_cuts_the_tool_comes_back_to_the_contact_that_it_left(made):
    path, scene, oriented = made
    row = int(cuts_in_a_row(path)[40])
    lifted = oriented(lambda axes, kinds, blocked: at(axes, row - 1))
    ((first, last),) = lifted.lifts
    assert first == row
    away = slice(first, last + 1)
    assert (lifted.kinds[away] != MoveKind.CUT).all()
    assert np.isnan(lifted.contacts[away]).all()
    safe = path.tips[0]
    assert np.linalg.norm(lifted.tips[away] - safe, axis=1).min() < 1e-9
    again = last + 1
    for array in (lifted.tips, lifted.axes, lifted.contacts):
        assert np.array_equal(array[again], array[row - 1])
    assert lifted.feed_rates[again] == NcJob().plunge_feed
    assert lifted.feed_rates[again + 1] == path.feed_rates[row]
    kept = np.r_[0:first, again + 1 : len(lifted.tips)]
    assert np.array_equal(lifted.tips[kept], path.tips)
    assert np.array_equal(lifted.kinds[kept], path.kinds)
    later = path.pass_index[row:] >= 0
    assert np.array_equal(lifted.pass_index[kept][row:][later], path.pass_index[row:][later] + 1)
    material = MeshDistance(scene.material)
    rapid = lifted.kinds[away] == MoveKind.RAPID
    clear = material.signed(lifted.balls[away][rapid]) - path.cutter.radius
    assert clear.min() >= PathJob().clearance
    assert angles_between(lifted.axes[away], np.tile([0.0, 0, 1], (last + 1 - first, 1))).min() < 1e-9


def test_from_a_link_the_tool_comes_back_to_where_the_link_leads(made):
    path, _, oriented = made
    cut = path.kinds == MoveKind.CUT
    row = int(np.flatnonzero((path.kinds == MoveKind.LINK) & np.r_[False, cut[:-1]])[1])
    lifted = oriented(lambda axes, kinds, blocked: at(axes, row - 1))
    ((first, last),) = lifted.lifts
    assert first == row
    kept = np.r_[0:first, last + 1 : len(lifted.tips)]
    assert np.array_equal(lifted.tips[kept], path.tips)
    assert np.array_equal(lifted.feed_rates[kept], path.feed_rates)
    assert np.array_equal(lifted.pass_index[kept], path.pass_index)


def test_several_lifts_keep_their_places(made):
    path, _, oriented = made
    rows = cuts_in_a_row(path)[[10, 11, 60]]
    lifted = oriented(lambda axes, kinds, blocked: at(axes, *(rows - 1)))
    assert len(lifted.lifts) == 3
    assert (lifted.kinds == MoveKind.CUT).sum() == (path.kinds == MoveKind.CUT).sum() + 3
    before = lifted.tips[lifted.lifts[:, 0] - 1]
    assert np.array_equal(before, path.tips[rows - 1])
    assert np.array_equal(lifted.tips[lifted.lifts[:, 1] + 1], before)


def test_a_place_that_cannot_be_left_is_not_asked_for_again(made, monkeypatch):
    path, _, oriented = made
    blocked, free = cuts_in_a_row(path)[[20, 30]].tolist()

    class Blocked(links.Transfers):
        """Transfers, but no lifts from one pose."""

        def find(self, pairs):  # type: ignore[no-untyped-def]
            lifts = self.traverses is links.LIFT_TRAVERSES
            ways = zip(pairs, super().find(pairs), strict=True)
            return [None if lifts and blocked - 1 in pair else way for pair, way in ways]

    monkeypatch.setattr(links, "Transfers", Blocked)

    def places(axes, kinds, left):
        return at(axes, free - 1 if blocked - 1 in left else blocked - 1)

    assert oriented(places).lifts[0, 0] == free

    def never(axes, kinds, left):
        if blocked - 1 in left:
            raise MachineError("point 7: no way", row=7)
        return at(axes, blocked - 1)

    with pytest.raises(MachineError, match=f"level {path.level}, point 7: no way") as caught:
        oriented(never)
    assert caught.value.evidence["row"] == 7


def test_between_two_rows_the_path_has_a_point_where_it_is_lifted(made):
    path, _, oriented = made
    row = int(cuts_in_a_row(path)[50])
    axis = unit(path.axes[[row - 1]] + path.axes[[row]])
    lifted = oriented(lambda axes, kinds, blocked: (np.array([row - 0.5]), axis))
    ((first, last),) = lifted.lifts
    for point in (first - 1, last + 1):
        assert np.allclose(lifted.balls[point], path.balls[row - 1 : row + 1].mean(axis=0))
        assert np.array_equal(lifted.axes[point], axis[0])
        assert lifted.kinds[point] == MoveKind.CUT
    kept = np.r_[0 : first - 1, last + 2 : len(lifted.tips)]
    assert np.array_equal(lifted.tips[kept], path.tips)
    assert lifted.feed_rates[first - 1] == path.feed_rates[row]


def test_a_path_within_the_limits_stays_as_it_is(made):
    path, _, oriented = made
    same = oriented(lambda axes, kinds, blocked: at(axes))
    assert np.array_equal(same.tips, path.tips)
    assert not len(same.lifts)


FLOOR, RADIUS = 35.0, 1.0
ALONG = np.arange(-4.0, 4.1, 0.5)


def floor(wall: float) -> LinkSpace:
    """What is planned in over a floor with a wall from a place on in y, mm."""
    mesh = boxes(([-9, -10, FLOOR - 5], [9, 12, FLOOR]), ([-9, wall, FLOOR], [9, wall + 2, FLOOR + 6]))
    scene = Scene(
        mesh, mesh, smallest_capsule(mesh.vertices, 0.5), Post(2.0, FLOOR - 5), known_level_distance=MeshDistance(mesh)
    )
    thin = Cutter(1, "ball", RADIUS, 1.0, 0.8, 40.0, (Frustum(30.0, 4.0, 4.0),), 4500.0, 900.0, 0.02)
    checker = CollisionChecker(scene, thin, 2.0)
    feeds = Feeds(1500.0, 300.0, 10000.0)
    return LinkSpace(checker, MachineLimits(np.radians(80.0)), feeds, 2.0, 0.01, None, RADIUS)


def lines(*xs: float) -> tuple[tuple[ndarray, ndarray, ndarray], list[ndarray]]:
    """Contacts of straight cuts along +y at some x, and their runs."""
    places = [[x, y, FLOOR + RADIUS] for x in xs for y in ALONG]
    up = np.tile([0.0, 0, 1], (len(places), 1))
    runs = [np.arange(len(ALONG)) + k * len(ALONG) for k in range(len(xs))]
    return (np.array(places), up, up), runs


def test_an_arc_is_tangential_to_the_cut_and_rises_from_it():
    contacts, runs = lines(0.0)
    (into,), (out,) = arcs_to(floor(9.0), contacts, runs), arcs_from(floor(9.0), contacts, runs)
    assert into is not None
    assert out is not None
    for (centres, axes), end, way in ((into, ALONG[0], -1.0), (out, ALONG[-1], 1.0)):
        assert len(centres) == ARC_STEPS
        middle = np.array([0.0, end, FLOOR + 2 * RADIUS])
        assert np.allclose(np.linalg.norm(centres - middle, axis=1), RADIUS)
        assert (np.diff(centres[:, 2]) > 0).all()
        assert (way * (centres[:, 1] - end) > 0).all()
        assert (axes == [0, 0, 1]).all()
    assert begins_tangentially(into[0][0], contacts[0][runs[0]])
    assert not begins_tangentially(contacts[0][0] + [0, 0, 1.0], contacts[0][runs[0]])


def test_an_arc_that_would_go_through_a_wall_is_refused_and_a_smaller_one_taken():
    """The ball is 0.3 mm, then 0.02 mm off the wall where the cut ends."""
    contacts, runs = lines(0.0)
    (small,) = arcs_from(floor(ALONG[-1] + RADIUS + 0.3), contacts, runs)
    assert small is not None
    assert small[0][:, 1].max() <= ALONG[-1] + 0.3
    near = floor(ALONG[-1] + RADIUS + 0.02)
    assert arcs_from(near, contacts, runs) == [None]


def test_runs_are_linked_by_their_arcs_and_straight_where_there_is_none():
    """The first approach comes on an arc at the feed of cuts, no move of it at the plunge feed; beside the wall the
    last contact is left straight up."""
    space = floor(ALONG[-1] + RADIUS + 0.02)
    contacts, runs = lines(-3.0, 3.0)
    leads = find_leads(space, contacts, runs, [None])
    assert sorted(leads.enter) == [0, len(ALONG)]
    assert not leads.leave
    poses = list(zip(contacts[0], contacts[2]))
    found = link_runs(space, poses, runs, [None], leads)
    assert [k for k, _ in found.links] == [0, 1]
    for (_, link), run in zip(found.links, runs, strict=True):
        assert begins_tangentially(link.centres[-1], contacts[0][run])
        assert (link.feeds[-ARC_STEPS:] == 900.0).all()
        assert (link.kinds[-ARC_STEPS:] == MoveKind.LINK).all()
        assert 300.0 not in link.feeds
    assert found.home is not None
    assert np.allclose(found.home.centres[0, :2], contacts[0][runs[1][-1], :2])


def test_a_direct_link_goes_from_arc_to_arc():
    """The axis leans, for no link stands at the pole of the rotary axes."""
    (centres, normals, _), runs = lines(0.0, 1.0)
    axes = unit(normals + np.array([0.2, 0, 0]))
    runs[1] = runs[1][::-1]
    (link,) = led_links(floor(9.0), (centres, normals, axes), [runs[0]], [runs[1]], 2.5)
    assert link is not None
    assert begins_tangentially(link.centres[-1], centres[runs[1]])
    assert (np.linalg.norm(np.diff(link.centres, axis=0), axis=1) > 0).all()


LOW, ROOF = 35.0, 55.0
LINE = np.arange(-9.0, 9.1, 0.5)
"""y of the contacts of a run, mm."""


@pytest.fixture(scope="module")
def roofed():
    """A plate with a roof over y > 3: no tool that stands below it gets away."""
    mesh = boxes(([-9, -10, LOW - 5], [9, 10, LOW]), ([-9, 3, ROOF], [9, 10, ROOF + 3]))
    scene = Scene(
        mesh, mesh, smallest_capsule(mesh.vertices, 0.5), Post(2.0, LOW - 5), known_level_distance=MeshDistance(mesh)
    )
    thin = Cutter(1, "ball", 1.0, 1.0, 0.8, 40.0, (Frustum(30.0, 4.0, 4.0),), 4500.0, 900.0, 0.02)
    return LinkSpace(
        CollisionChecker(scene, thin, 2.0), MachineLimits(np.radians(80.0)), Feeds(1500.0, 300.0, 10000.0), 2.0, 0.01
    )


def poses_at(x: float, along: ndarray) -> list[Pose]:
    return [(np.array([x, y, LOW + 1.0]), np.array([0.0, 0.0, 1.0])) for y in along]


@pytest.mark.whole
def test_a_run_that_ends_where_the_tool_is_caught_is_cut_short_and_the_next_is_reached(roofed):
    poses = poses_at(-3.0, LINE) + poses_at(3.0, LINE[::-1])
    runs = [np.arange(len(LINE)), np.arange(len(LINE)) + len(LINE)]
    found = link_runs(roofed, poses, runs, [None])
    assert [k for k, _ in found.links] == [0, 1]
    assert found.home is not None
    (first, second) = found.runs
    assert first[0] == runs[0][0]
    assert second[-1] == runs[1][-1]
    for run, whole in zip(found.runs, runs, strict=True):
        heights = [poses[i][0][1] for i in run]
        assert max(heights) < 3.0, "not below the roof"
        assert len(run) > 8
        assert set(run) < set(whole)


def test_runs_that_are_reached_stay_whole_and_one_that_lies_all_below_the_roof_is_left_out(roofed):
    free, caught = LINE[LINE < 0], LINE[LINE > 6]
    poses = poses_at(-3.0, free) + poses_at(0.0, caught)
    runs = [np.arange(len(free)), np.arange(len(caught)) + len(free)]
    found = link_runs(roofed, poses, runs, [None])
    assert [k for k, _ in found.links] == [0]
    assert all(np.array_equal(run, whole) for run, whole in zip(found.runs, runs, strict=True))


Poses = tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"]]


@dataclass(frozen=True, eq=False)
class Grooved:
    """A pebble with a groove under 0.4 mm of material, and what links over it are planned in."""

    surface: TSpline
    space: LinkSpace

    def poses(self, s: float, t: float, lift: float = 0.0) -> Poses:
        """The ball at a place of the surface, lifted by so much (mm), its axis normal to it."""
        at = np.array([s]), np.array([t])
        normals = self.surface.normals(*at)
        return self.surface.positions(*at) + (self.space.ball_radius + lift) * normals, normals, normals


@pytest.fixture(scope="module")
def grooved():
    surface, material = grooved_pebble(0.8), mesh_of(grooved_pebble(0.8, 0.4))
    level = mesh_of(surface)
    checker = CollisionChecker(Scene(level, material, UPRIGHT_CAPSULE, post_below(level, HOLDING)), ROUGHING_CUTTER)
    job = PathJob()
    planned = (MachineLimits(np.radians(115.0)), Feeds(500.0, 200.0, 5000.0), job.clearance, job.gouge_tolerance)
    return Grooved(surface, LinkSpace(checker, *planned, HeightMesh(material)))


def test_the_tool_steps_over_to_a_place_nearby(grooved):
    ends, starts = grooved.poses(0.1, 0.3, 0.1), grooved.poses(0.1, 0.315, 0.1)
    assert 0.2 < np.linalg.norm(ends[0] - starts[0]) < 1.0
    assert steps_over(grooved.space, ends, starts, 5.0).all()
    assert not steps_over(grooved.space, ends, starts, 0.1).any()


def test_no_step_over_goes_into_the_level(grooved):
    ends, starts = grooved.poses(0.1, 0.3), grooved.poses(0.2, 0.3)
    assert not grooved.space.ball_free(ends[0], starts[0]).any()
    assert not steps_over(replace(grooved.space, material=None), ends, starts, 50.0).any()


def test_no_step_over_goes_deeper_than_the_passes(grooved):
    """From air to air round the pebble, over material."""
    ends, starts = grooved.poses(0.1, 0.3, 0.65), grooved.poses(0.15, 0.3, 0.65)
    assert grooved.space.ball_free(ends[0], starts[0]).all()
    assert not steps_over(grooved.space, ends, starts, 50.0).any()
    assert steps_over(replace(grooved.space, material=None), ends, starts, 50.0).all()


def test_no_step_over_turns_far(grooved):
    (centres, normals, axes), starts = grooved.poses(0.1, 0.3, 0.1), grooved.poses(0.1, 0.315, 0.1)
    assert not steps_over(grooved.space, (centres, normals, -axes), starts, 5.0).any()


def test_nothing_is_stepped_over_where_there_is_one_run(grooved):
    none = (np.zeros((0, 3)),) * 3
    assert not len(steps_over(grooved.space, none, none, 5.0))
