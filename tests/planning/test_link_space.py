"""What links may remove: the whole cutter counts, flutes too.

Ways off the surface where the tool stands in a narrow slit.

Traverses round the stock: off its surface all along, within the limits, in small steps.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from boxes import BOX
from small_parts import HOLDING, ROUGHING_CUTTER, UPRIGHT_CAPSULE, level_of, path_of, pebble

from bonecam.arrays import angles_between, unit
from bonecam.levels import StockLevel
from bonecam.levels.measure import NO_CUT
from bonecam.machine import MachineLimits
from bonecam.machine.bodies import Frustum
from bonecam.material import remove_material, uncut_material
from bonecam.material.dexels import uncut_rays
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.planning import Scene, link_space, links
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.layers import HeightMesh
from bonecam.planning.link_space import (
    ARC_ALLOWED,
    CUT_ALLOWED,
    MAX_TURN,
    ClearanceSurface,
    Feeds,
    LinkSpace,
    TraverseOptions,
    departures,
    find_retracts,
    traverse,
)
from bonecam.planning.links import direct_links
from bonecam.setup import Capsule, smallest_capsule
from bonecam.tool import Cutter, MoveKind
from bonecam.workholding import Post, post_below

UP = np.array([0.0, 0.0, 1.0])
Poses = tuple[np.ndarray, np.ndarray]


def upright(centres: np.ndarray) -> Poses:
    return centres, np.tile(UP, (len(centres), 1))


@pytest.fixture(scope="module")
def space():
    """The uncut stock, and a tool whose flutes reach 4 mm above its ball's centre."""
    part = level_of(pebble())
    levels = [part, StockLevel(1, UPRIGHT_CAPSULE.mesh(0.01), 0.5, NO_CUT)]
    post = post_below(part.mesh, HOLDING)
    scene = Scene(part.mesh, UPRIGHT_CAPSULE.mesh(0.01), UPRIGHT_CAPSULE, post)
    long = replace(ROUGHING_CUTTER, flute_length=ROUGHING_CUTTER.radius + 4.0)
    limits, feeds = MachineLimits(np.radians(115.0)), Feeds(1500.0, 300.0, 10000.0)
    material = uncut_material(levels, UPRIGHT_CAPSULE)
    return LinkSpace(CollisionChecker(scene, long, 2.0), limits, feeds, 2.0, 0.01, material)


@pytest.fixture(scope="module")
def below(space):
    """Moves of the ball under the stock, in air, on which its flutes stand up into it."""
    low = float(UPRIGHT_CAPSULE.bounds[0, 2])
    across = np.linspace(-3.0, 3.0, 7)
    return upright(np.column_stack([across, 0 * across, np.full(7, low - space.ball_radius - 0.5)]))


def test_a_link_whose_flutes_cut_where_its_ball_is_in_air_is_refused(space, below):
    nowhere = upright(np.zeros((0, 3)))
    assert space.in_air(below[0][None]).all()
    lower = upright(below[0] - 5.0 * UP)
    assert space.cuts_little([below, lower], [nowhere, nowhere], np.full(2, CUT_ALLOWED)).tolist() == [False, True]


def test_a_link_of_a_layer_is_held_against_what_stands_on_rays(space, below):
    mesh, nowhere = UPRIGHT_CAPSULE.mesh(0.1), upright(np.zeros((0, 3)))
    lines = [below, upright(below[0] - 5.0 * UP)]
    standing = HeightMesh(mesh, rays=uncut_rays(UPRIGHT_CAPSULE))
    assert replace(space, material=standing).cuts_little(lines, [nowhere] * 2, np.full(2, CUT_ALLOWED)).tolist() == [
        False,
        True,
    ]
    side = UPRIGHT_CAPSULE.radius + space.ball_radius + np.array([0.05, 0.5])
    rapids = [upright(np.array([[x, 0.0, 36.0], [x, 0.0, 38.0]])) for x in side + float(UPRIGHT_CAPSULE.start[0])]
    assert replace(space, material=standing).rapids_cut_nothing(rapids).tolist() == [False, True]


def test_a_ball_is_known_to_be_in_air_outside_the_material_only(space):
    side = UPRIGHT_CAPSULE.radius + space.ball_radius + np.array([0.3, 0.0, -0.1])
    height = UPRIGHT_CAPSULE.bounds[:, 2].mean()
    centres = np.column_stack([side, 0 * side, np.full(3, height)]) + UPRIGHT_CAPSULE.start * [1.0, 1.0, 0.0]
    assert space.known_in_air(centres).tolist() == [True, True, False]
    assert not replace(space, material=None).known_in_air(centres).any()


def test_what_flutes_removed_on_a_pass_may_be_passed_again(space, below):
    centres, axes = below
    cutter = space.checker.cutter
    kinds, passes = np.full(len(centres), int(MoveKind.CUT)), np.zeros(len(centres), dtype=np.int64)
    path = path_of(centres - cutter.radius * axes, axes, kinds=kinds, passes=passes, tool=cutter)
    cut = replace(space, material=remove_material(space.material, level_of(pebble()), path))  # type: ignore[arg-type]
    assert cut.cuts_little([below], [upright(np.zeros((0, 3)))], np.array([CUT_ALLOWED])).all()


def beside_the_stock(space: LinkSpace, depth: float, *y: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ball centres, normals and axes at some y, all in air, where the flutes above stand `depth` (mm) in the stock's
    cylinder over y = 0."""
    stock = space.checker.scene.stock
    x = float(stock.radius) + space.ball_radius - depth
    axis = np.array([0.0, np.sin(0.1), np.cos(0.1)])
    centres = np.array([[x, place, float(stock.start[2]) + 1.0] for place in y]) - 3.0 * axis
    return centres, np.tile([1.0, 0.0, 0.0], (len(y), 1)), np.tile(axis, (len(y), 1))


def volume(space: LinkSpace, depth: float, *y: float, gone: int | None = None) -> float:
    """What flutes remove on the way through these y, mm3, behind the tool at the place `gone` of them."""
    line = beside_the_stock(space, depth, *y)[::2]
    removed = tuple(part[:0] if gone is None else part[[gone]] for part in line)
    (cut,) = space.material.rays.cutters.removed_by([line], [removed], 2.0, 4.0)  # type: ignore[union-attr]
    return float(cut)


def runs_straight(space: LinkSpace, depth: float, y: tuple[float, float], arcs: list[bool]) -> bool:
    """Whether there is a link from the one y to the other on the straight line; only rays tell against it."""
    first, last = (beside_the_stock(space, depth, place) for place in y)
    (link,) = direct_links(space, first, last, 3.0, (0.0,), np.array([arcs]))
    return link is not None and bool(link.centres[:, 0].max() < first[0][0, 0] + 0.1)


@pytest.fixture
def told_by_rays(space, monkeypatch):
    monkeypatch.setattr(links, "_proven_free", lambda _, centres, axes: np.ones(len(centres), dtype=bool))
    return space


def test_a_link_and_the_arcs_at_its_ends_share_what_may_be_removed_between_two_cuts(told_by_rays):
    space, depth = told_by_rays, 0.007
    assert CUT_ALLOWED - 2 * ARC_ALLOWED < volume(space, depth, -1.0, 1.0) < CUT_ALLOWED - ARC_ALLOWED
    line, nowhere = beside_the_stock(space, depth, -1.0, 1.0)[::2], upright(np.zeros((0, 3)))
    allowed = np.r_[CUT_ALLOWED - ARC_ALLOWED * np.arange(3), ARC_ALLOWED]
    assert space.cuts_little([line] * 4, [nowhere] * 4, allowed).tolist() == [True, True, False, False]
    assert runs_straight(space, depth, (-1.0, 1.0), [True, False])
    assert not runs_straight(space, depth, (-1.0, 1.0), [True, True])


def test_what_a_link_removes_of_the_cut_that_it_leads_to_counts(told_by_rays):
    """The simulation runs the link before that cut."""
    space, depth = told_by_rays, 0.012
    beside_it, whole = (volume(space, depth, -1.0, 0.0, gone=gone) for gone in (1, None))
    assert beside_it < CUT_ALLOWED - ARC_ALLOWED < whole
    assert not runs_straight(space, depth, (-1.0, 0.0), [False, True])
    assert runs_straight(space, depth / 2, (-1.0, 0.0), [False, True])


RADIUS, GAP, TOP = 2.0, 5.0, 41.0
CENTRE = np.array([0.0, 0.0, TOP - 5.0])


def slit(lean: float) -> TriangleMesh:
    """Two walls GAP apart round CENTRE along x, both leaning by `lean` (radians) towards +x."""
    corners = []
    for low, high in ((-9.0, -GAP / 2), (GAP / 2, 9.0)):
        box = np.array([[x, y, z] for x in (low, high) for y in (-9.0, 9.0) for z in (TOP - 11, TOP)])
        corners.append(box + np.outer(box[:, 2] - CENTRE[2], [np.tan(lean), 0, 0]))
    return TriangleMesh(np.vstack(corners), np.vstack([BOX, BOX + 8]).astype(np.int32))


def space_in(walls: TriangleMesh) -> LinkSpace:
    stock = smallest_capsule(walls.vertices, 0.5)
    scene = Scene(walls, walls, stock, Post(2.0, TOP - 15), known_level_distance=MeshDistance(walls))
    thin = Cutter(1, "ball", RADIUS, RADIUS, 2.0, 40.0, (Frustum(30.0, 16.0, 16.0),), 4500.0, 900.0, 0.02)
    limits = MachineLimits(np.radians(115.0))
    return LinkSpace(CollisionChecker(scene, thin, 2.0), limits, Feeds(1500.0, 300.0, 10000.0), 2.0, 0.01)


def test_between_leaning_walls_the_way_out_leans_as_they_do(monkeypatch):
    up = np.array([0.0, 0.0, 1.0])
    (straight,) = find_retracts(space_in(slit(0.0)), [(CENTRE, up)])
    assert straight is not None
    assert np.allclose(straight.moves.centres[:, :2], 0)

    leaning = space_in(slit(np.radians(15.0)))
    (found,) = find_retracts(leaning, [(CENTRE, up)])
    assert found is not None
    way = found.moves.centres[-1] - CENTRE
    assert 11 < np.degrees(np.arctan2(way[0], way[2])) < 17
    assert np.allclose(found.moves.axes, up)
    monkeypatch.setattr(link_space, "LEANS", np.zeros(0))
    assert find_retracts(leaning, [(CENTRE, up)]) == [None]


@pytest.mark.parametrize(("depth", "taken"), [(0.02, True), (0.1, False)])
def test_ways_that_all_cut_are_proven_once_and_the_first_that_cuts_little_is_taken(depth, taken, monkeypatch):
    leaning, pose = space_in(slit(np.radians(15.0))), (CENTRE, np.array([0.0, 0.0, 1.0]))
    (in_air,) = find_retracts(leaning, [pose])
    proofs = []
    proven = LinkSpace.polylines_free

    def counted(space, lines, *, cutting):
        proofs.append(cutting)
        return proven(space, lines, cutting=cutting)

    monkeypatch.setattr(LinkSpace, "polylines_free", counted)
    monkeypatch.setattr(LinkSpace, "left_in_air", lambda _, contacts, centres, deepest: [depth < deepest])
    (found,) = find_retracts(leaning, [pose])
    assert in_air is not None
    if taken:
        assert found is not None
        assert np.array_equal(found.moves.centres, in_air.moves.centres)
    else:
        assert found is None, "a link may not cut"
    assert proofs.count(True) == len(departures(pose[1]))


@pytest.mark.parametrize("asked", ["cuts_little", "rapids_cut_nothing"])
def test_no_way_is_taken_on_which_rays_tell_of_a_cut(asked, monkeypatch):
    monkeypatch.setattr(LinkSpace, asked, lambda _, lines, *contacts: np.zeros(len(lines), dtype=bool))
    assert find_retracts(space_in(slit(0.0)), [(CENTRE, np.array([0.0, 0.0, 1.0]))]) == [None]


def test_no_way_out_lets_a_drooping_tool_sink():
    axis = np.array([np.sin(2.0), 0.0, np.cos(2.0)])
    ways = departures(axis)
    assert np.allclose([np.linalg.norm(way.direction) for way in ways], 1.0)
    assert min(way.direction[2] for way in ways) >= axis[2] - 1e-12
    assert len({tuple(way.direction.round(9)) for way in ways}) > 5


STOCK = Capsule(np.array([1.0, -2.0, 45.0]), np.array([1.0, -2.0, 60.0]), 6.0)
SURFACE = ClearanceSurface(STOCK, 4.0)
LIMITS = MachineLimits(np.radians(115.0))


def pose(direction: list[float], height: float) -> tuple[np.ndarray, np.ndarray]:
    """Where a ball that left along `direction` crosses the clearance surface."""
    axis = unit(np.array([direction], dtype=np.float64))[0]
    start = np.array([1.0, -2.0, height])
    return start + SURFACE.exit_lengths(start[None], axis[None])[0] * axis, axis


ENDS = [
    (pose([1, 0, 0], 50), pose([-1, 0.1, 0], 55)),
    (pose([1, 0, -0.4], 46), pose([0, 1, 0.5], 60)),
    (pose([0.3, 0, 1], 58), pose([0, -1, -0.4], 45)),
]
OPTIONS = [
    TraverseOptions(),
    TraverseOptions(long_way=True),
    TraverseOptions(rise=5.0),
    TraverseOptions(over_pole=True),
]


@pytest.mark.parametrize("case", range(len(ENDS)))
@pytest.mark.parametrize("options", OPTIONS)
def test_the_ball_stays_outside_and_the_axis_within_limits(case, options):
    first, last = ENDS[case]
    centres, axes = traverse(SURFACE, first, last, LIMITS, options)
    assert np.allclose(centres[[0, -1]], [first[0], last[0]])
    assert np.allclose(axes[[0, -1]], [first[1], last[1]])
    fine = np.vstack([np.linspace(a, b, 9) for a, b in pairwise(centres)])
    assert STOCK.signed_distance(fine).min() > 4.0 - 0.2
    assert LIMITS.allow(axes).all()
    assert angles_between(axes[1:], axes[:-1]).max() < 2.5 * MAX_TURN


def test_the_exit_lies_on_the_surface():
    for end in (end for pair in ENDS for end in pair):
        assert STOCK.signed_distance(end[0][None])[0] == pytest.approx(4.0, abs=1e-9)


def test_coordinates_lead_back_to_their_points():
    rng = np.random.default_rng(1)
    for point in np.array([1.0, -2.0, 52.0]) + rng.normal(size=(40, 3)) * 30:
        azimuth, arc, height = SURFACE.coordinates(point)
        found, frames = SURFACE.frames(np.array([azimuth]), np.array([arc]), np.array([height]))
        assert np.allclose(found[0], point)
        assert np.allclose(frames[0].T @ frames[0], np.eye(3))
