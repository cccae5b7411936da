"""Open surfaces: from a blade's side, or a blade open at both ends, to an offset or a given surface."""

from itertools import pairwise

import numpy as np
import pytest
from level_parts import waisted

from bonecam.errors import JobError, LevelError, StockError, SurfaceError
from bonecam.levels import Level, Morph, levels_in, morph_open
from bonecam.mesh import TriangleMesh
from bonecam.setup import Capsule, Schedule
from bonecam.surface import TSpline, skin

SCHEDULE = Schedule((0.1,), 0.5)


def side() -> TSpline:
    """A twisted, bent sheet of 20 x 30 mm."""
    u = np.linspace(-1, 1, 21)
    rows = [np.column_stack([10 * u, 2 * u**2 + 3 * u * v, 15 * v + 0 * u]) for v in np.linspace(-1, 1, 9)]
    return skin(rows, 0.02, closed=False)


def tube() -> TSpline:
    """A blade of elliptic section, 12 x 4 mm, twisted by 20 degrees over 25 mm, open at both ends."""
    angle = 2 * np.pi * np.arange(40) / 40
    rows = []
    for v in np.linspace(0, 1, 8):
        x, y, turn = 6 * np.cos(angle), 2 * np.sin(angle), np.radians(20) * v
        rows.append(
            np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), 25 * v + 0 * x])
        )
    return skin(rows, 0.02, closed=True)


BLADES = {"side": side, "tube": tube}


@pytest.mark.parametrize("blade", BLADES)
def test_the_morph_of_a_closed_part_refuses_an_open_one_at_once(blade):
    with pytest.raises(SurfaceError, match=r"not closed between two poles: morph an open one with .*morph_open"):
        levels_in(BLADES[blade](), Capsule(np.array([0.0, 0, -30]), np.array([0.0, 0, 60]), 40.0), SCHEDULE)


@pytest.fixture(
    scope="module", params=[(blade, edges) for blade in BLADES for edges in ("free", "fixed")], ids="-".join
)
def made(request):
    blade, edges = request.param
    surface = BLADES[blade]()
    return surface, edges, morph_open(surface, 2.0, SCHEDULE, edges=edges, chord_tolerance=0.02)


def moves_of(morph: Morph, s: np.ndarray, t: np.ndarray) -> list[np.ndarray]:
    surfaces = [level.surface for level in morph.levels[:-1] if level.surface is not None]
    return [outer.positions(s, t) - inner.positions(s, t) for inner, outer in pairwise(surfaces)]


def test_as_few_levels_as_the_depths_allow_or_one_more(made):
    morph = made[2]
    assert morph.lower_bound <= morph.cuts <= morph.lower_bound + 1


def test_no_point_moves_further_than_the_depth_or_falls_behind(made):
    s, t = np.random.default_rng(9).random((2, 2000))
    for level, move in zip(made[2].levels[1:], moves_of(made[2], s, t)):
        assert np.linalg.norm(move, axis=1).max() <= level.limit + 1e-9
        assert level.depth_max <= level.limit + 0.002
        assert level.nesting_min >= -0.001
        assert level.measures.self_intersections == 0


def test_fixed_edges_stay_and_free_ones_go_with_the_stock(made):
    surface, edges, morph = made
    s = np.linspace(0.02, 0.98, 50)
    for end in surface.domain[1]:
        moved = sum(np.linalg.norm(move, axis=1) for move in moves_of(morph, s, np.full(50, end)))
        assert (np.max(moved) < 1e-9) == (edges == "fixed")


def test_the_last_level_is_the_offset():
    surface, morph = side(), morph_open(side(), -1.3, SCHEDULE, chord_tolerance=0.02)
    feet = surface.project(morph.levels[-1].mesh.vertices)
    assert np.abs(feet.distances - 1.3).max() < 0.02
    ahead = morph.levels[-1].mesh.vertices - feet.points
    assert (ahead * surface.normals(*feet.parameters.T)).sum(1).max() < 0


def test_a_given_surface_is_met():
    u = np.linspace(-1.3, 1.3, 25)
    plane = skin(
        [np.column_stack([10 * u, 0 * u + 8.0 + 0.5 * v, 17 * v + 0 * u]) for v in np.linspace(-1, 1, 6)],
        0.01,
        closed=False,
    )
    for stock in (plane, plane.tessellate(0.01)):
        morph = morph_open(side(), stock, SCHEDULE, chord_tolerance=0.05)
        assert np.abs(plane.project(morph.levels[-1].mesh.vertices).distances).max() < 0.05
        assert morph.distance == pytest.approx(9.4, abs=0.1)


def test_a_stock_through_the_part_is_refused_with_its_place():
    flat = skin(
        [np.column_stack([np.linspace(-12, 12, 9), np.full(9, 1.0), np.full(9, z)]) for z in np.linspace(-18, 18, 5)],
        0.01,
        closed=False,
    )
    with pytest.raises(StockError, match="behind the part at") as caught:
        morph_open(side(), flat, SCHEDULE)
    assert caught.value.evidence["distance"] > 0.5


def test_an_offset_beyond_the_thickness_is_an_error_with_the_level():
    with pytest.raises((LevelError, StockError), match=r"behind|turns over"):
        morph_open(tube(), -3.0, SCHEDULE, chord_tolerance=0.05)


def test_wrong_calls_are_refused():
    with pytest.raises(SurfaceError, match=r"the surface is closed: .*levels_in\(surface, stock, schedule\)"):
        morph_open(waisted(), 1.0, SCHEDULE)
    with pytest.raises(JobError, match="edges = 'loose': choose one of free, fixed"):
        morph_open(side(), 1.0, SCHEDULE, edges="loose")
    with pytest.raises(StockError, match="no stock"):
        morph_open(side(), 0.0, SCHEDULE)
    for stiffness in (np.nan, np.inf, -1e-9):
        with pytest.raises(JobError, match=r"stiffness = .*: give a finite number of zero or more"):
            morph_open(side(), 1.0, SCHEDULE, stiffness=stiffness)
    with pytest.raises(StockError, match="a Capsule is no stock of an open surface"):
        morph_open(side(), Capsule(np.zeros(3), np.ones(3), 50.0), SCHEDULE)
    with pytest.raises(StockError, match="a mesh without faces is no stock"):
        morph_open(side(), TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32)), SCHEDULE)


def blade() -> TSpline:
    """A wave of 50 x 60 mm, with radii of curvature from 45 mm."""
    x = np.linspace(0, 50, 30)
    return skin(
        [np.column_stack([x, np.full(30, y), 5 * np.sin(x / 15)]) for y in range(0, 70, 10)], 0.01, closed=False
    )


def above(height: float, bump: float) -> TriangleMesh:
    """A mesh so far above the blade, with a bump of 1 mm radius in the middle."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-5, 55, 121), np.linspace(-5, 65, 141), indexing="ij"))
    z = 5 * np.sin(x / 15) + height + bump * np.exp(-((x - 25) ** 2 + (y - 30) ** 2) / 2)
    a, b, c, d = (
        i.ravel()
        for i in (lambda n: (n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]))(np.arange(len(x)).reshape(121, 141))
    )
    return TriangleMesh(
        np.column_stack([x, y, z]), np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.int32)
    )


def test_a_stock_with_a_dent_through_the_part_is_refused_where_it_is():
    with pytest.raises(StockError, match=r"3.990 mm behind the part at") as caught:
        morph_open(blade(), above(2.0, -6.0), SCHEDULE)
    assert caught.value.evidence["distance"] == pytest.approx(3.99, abs=0.01)
    assert caught.value.evidence["place"] == pytest.approx([25, 30, 0.98], abs=0.1)


def test_a_ridge_that_the_control_points_miss_is_refused_with_how_far_and_where():
    with pytest.raises(
        StockError, match=r"5.98. mm off the one given at .*: give a smoother stock or more control points"
    ) as caught:
        morph_open(blade(), above(2.0, 6.0), SCHEDULE)
    assert caught.value.evidence["place"] == pytest.approx([25, 30, 12.98], abs=0.1)


def test_a_small_bump_counts_in_the_distance_and_is_reported():
    morph = morph_open(blade(), above(2.0, 0.2), SCHEDULE)
    assert morph.distance == pytest.approx(2.2, abs=0.05)
    assert morph.levels[-1].outside == pytest.approx(0.2, abs=0.03)
    assert morph.lower_bound == SCHEDULE.lower_bound(morph.distance) <= morph.cuts


@pytest.mark.whole
def test_offsets_that_turn_over_are_refused_and_others_are_exact():
    for offset in (-48.0, -60.0):
        remedy = "give one that reaches over all of the part, nearer to it than its radii of curvature"
        with pytest.raises(StockError, match=rf"turns over at .*: {remedy}"):
            morph_open(blade(), offset, Schedule((), 5.0))
    morph = morph_open(blade(), np.float32(-30), Schedule((), 5.0))
    assert morph.distance == pytest.approx(30.0, abs=1e-6)
    assert morph.levels[-1].outside < 0.05


@pytest.mark.parametrize("offset", [2.0, -2.0, 3.0])
def test_an_offset_of_whole_depths_takes_no_cut_that_removes_nothing(offset):
    """On a plane: 0.5 mm at a time, four cuts for 2 mm."""
    plate = skin(
        [np.column_stack([np.linspace(0, 30, 8), np.full(8, y), np.zeros(8)]) for y in range(0, 31, 5)],
        0.01,
        closed=False,
    )
    morph = morph_open(plate, offset, Schedule((), 0.5))
    assert morph.cuts == morph.lower_bound == abs(offset) / 0.5
    assert min(level.depth_max for level in morph.levels[1:]) > 0.49


def test_a_chord_tolerance_out_of_range_is_refused():
    with pytest.raises(JobError, match=r"chord_tolerance = 20.*keep it within"):
        morph_open(side(), 1.0, SCHEDULE, chord_tolerance=20.0)


def test_numbers_of_any_kind_are_offsets():
    assert morph_open(side(), np.int64(1), SCHEDULE).distance == pytest.approx(1.0)


@pytest.mark.parametrize("edges", ["free", "fixed"])
def test_the_last_cut_keeps_its_depth_from_the_bottom_of_a_groove(edges):
    x = np.linspace(0, 20, 200)
    groove = skin(
        [np.column_stack([x, np.full(200, y), -2 * np.exp(-((x - 10) ** 2))]) for y in range(0, 20, 4)],
        0.02,
        closed=False,
    )
    flat = TriangleMesh(
        np.array([[-5.0, -5, 1], [25, -5, 1], [25, 25, 1], [-5, 25, 1]]), np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    )
    morph = morph_open(groove, flat, Schedule((), 0.5), edges=edges)
    assert max(level.deepest for level in morph.levels[1:]) <= 0.502
    rest = morph.levels[-2].mesh.vertices[:, 2]
    assert edges == "fixed" or 1 - rest.min() <= 0.51


def test_a_stock_may_meet_fixed_edges_but_not_cross_them():
    u, v = np.linspace(-1, 1, 21), np.linspace(-1, 1, 9)
    flat, bulge = (
        skin([np.column_stack([10 * u, 0 * u + 15 * w, h * (1 - u**2) * (1 - w**2)]) for w in v], 1e-3, closed=False)
        for h in (0, 2)
    )
    bulge_mesh = bulge.tessellate(1e-3)
    assert morph_open(flat, bulge_mesh, Schedule((), 1.0), edges="fixed").distance == pytest.approx(2.0, abs=0.03)
    with pytest.raises(StockError, match="touches the part"):
        morph_open(flat, bulge_mesh, Schedule((), 1.0))
    lower = TriangleMesh(bulge_mesh.vertices - [0, 0, 0.1], bulge_mesh.faces)
    with pytest.raises(StockError, match=r"0.100 mm behind the part"):
        morph_open(flat, lower, Schedule((), 1.0), edges="fixed")


def test_open_levels_are_measured_on_their_surfaces_and_tell_the_depth_used(made):
    cuts = made[2].levels[1:]
    area = made[0].area
    assert all(level.deepest <= level.limit + 0.002 for level in cuts)
    assert all(0 < level.measures.full_depth_mean <= level.limit + 1e-9 for level in cuts)
    assert cuts[0].measures.full_depth_area <= area * 1.001
    assert 0.5 < made[2].depth_used < 1.0
    assert made[1] == "fixed" or cuts[0].measures.full_depth_area == pytest.approx(area, rel=0.01)


def test_the_depth_back_of_a_finishing_cut_is_exact():
    cuts: tuple[Level, ...] = morph_open(blade(), -3.0, Schedule((0.1, 0.1), 0.5)).levels[1:]
    assert cuts[0].measures.reverse_depth_max == pytest.approx(0.1, abs=5e-4)


def test_the_fewest_cuts_of_an_offset_are_no_more_where_its_edges_bend():
    """With fixed edges the fit of this offset bulges 0.002 mm beyond it."""
    x = np.linspace(0, 50, 30)
    blade = skin(
        [np.column_stack([x, np.full(30, y), 5 * np.sin(x / 15)]) for y in range(0, 70, 10)], 0.01, closed=False
    )
    made = morph_open(blade, 3.0, Schedule((0.1, 0.1), 2.8), edges="fixed", chord_tolerance=0.02)
    assert made.distance == pytest.approx(3.0, abs=1e-9)
    assert made.lower_bound == 3 <= made.cuts


def test_a_stock_over_the_parts_own_net_is_met_point_by_point():
    part = side()
    shift = np.array([0.1, -2.0, 0.2])
    stock = part.with_control_points(part.control_points + shift)
    morph = morph_open(part, stock, Schedule((), 0.5), chord_tolerance=0.05)
    s, t = (x.ravel() for x in np.meshgrid(*(np.linspace(*ends, 9) for ends in part.domain)))
    length = float(np.linalg.norm(shift))
    for level in morph.levels[1:-1]:
        assert level.surface is not None
        way = level.surface.positions(s, t) - part.positions(s, t)
        np.testing.assert_allclose(way, np.outer(way @ shift / length**2, shift), atol=1e-3)
        np.testing.assert_allclose(np.linalg.norm(way, axis=1), 0.5 * level.index, atol=1e-3)
    assert morph.levels[-1].outside < 0.02
