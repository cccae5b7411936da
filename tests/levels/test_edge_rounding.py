"""Stocks with edges: rounded as far as the part allows, then cut down to that in levels of a known depth."""

import numpy as np
import pytest
from level_parts import waisted
from mesh_bodies import is_closed

from bonecam.arrays import unit
from bonecam.errors import LevelError, StockError
from bonecam.job import Job, MeshJob, StockJob
from bonecam.levels import RoundedLevel, levels_in, open_morph
from bonecam.levels.job_levels import make_levels
from bonecam.levels.measure import (
    BINS,
    MeasuredSurface,
    level_grid,
    machined_levels,
    measure_last_cut,
    require_none,
    violations,
)
from bonecam.levels.open_morph import TOLERANCE, body_surfaces
from bonecam.mesh import TriangleMesh, exact_closest, prepare_part, self_intersections
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.mesh.solids import revolve
from bonecam.setup import Box, Capsule, ConvexStock, Cylinder, RoundedStock, Schedule, Stock, enclosing_capsule, place
from bonecam.setup.rounding import half_spaces_of, intersect, round_most
from bonecam.surface.part_surface import fit_surface

pytestmark = pytest.mark.whole

BAR, BOX = Cylinder(4.5, 0.0, 20.0), Box(np.array([-4.5, -4.0, 0.0]), np.array([4.5, 4.0, 20.0]))
SCHEDULE = Schedule((0.1,), 0.9)
STOCKS: dict[str, Stock] = {"cylinder": BAR, "box": BOX, "mesh": ConvexStock(BOX.mesh(2.0))}


def cloud(low: float, high: float) -> np.ndarray:
    points = np.random.default_rng(11).normal(size=(300, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * [2.5, 2.5, (high - low) / 2] + [0, 0, (low + high) / 2]


@pytest.mark.parametrize("stock", STOCKS.values(), ids=STOCKS)
def test_a_rounded_stock_lies_inside_and_its_distances_are_exact(stock):
    body = RoundedStock(stock.offset(-2.0), 2.0)
    mesh, points = body.mesh(0.02), np.random.default_rng(2).uniform(-8, 26, (300, 3))
    assert stock.signed_distance(mesh.vertices).max() < 1e-6
    assert np.abs(body.signed_distance(mesh.vertices)).max() < 1e-9
    assert mesh.volume < stock.mesh(0.02).volume
    distance, nearest = body.signed_distance(points), body.closest_points(points)
    assert np.abs(body.signed_distance(nearest)).max() < 1e-9
    assert np.allclose(np.linalg.norm(points - nearest, axis=1), np.abs(distance), atol=1e-9)
    assert np.allclose(mesh.bounds, body.bounds, atol=0.02)


def ball_of_slivers() -> ConvexStock:
    points = np.random.default_rng(5).normal(size=(600, 3))
    return ConvexStock(convex_hull(points / np.linalg.norm(points, axis=1)[:, None] * [8.0, 6.0, 13.0]))


ROUNDED = {
    "slivers": ball_of_slivers().round_edges(5.0),
    "tight box": Box(np.array([-5.0, -4.0, -10.0]), np.array([5.0, 4.0, 10.0])).round_edges(1.4),
    "box": Box(np.array([-7.0, -6.0, -11.0]), np.array([7.0, 6.0, 11.0])).round_edges(5.9),
    "flat disc": Cylinder(9.0, 0.0, 2.0).round_edges(0.7),
}


@pytest.mark.parametrize("chord", [0.01, 0.1])
@pytest.mark.parametrize("body", ROUNDED.values(), ids=ROUNDED)
def test_the_mesh_of_a_rounded_body_keeps_its_tolerance_and_does_not_cut_itself(body, chord):
    mesh, rng = body.mesh(chord), np.random.default_rng(3)
    corners = mesh.vertices[mesh.faces]
    inside = body.signed_distance(np.einsum("kc,fcx->fkx", rng.dirichlet(np.ones(3), 10), corners).reshape(-1, 3))
    assert -chord <= inside.min() <= inside.max() < 1e-9
    surface = body.closest_points(body.middle + 100 * rng.normal(size=(5000, 3)))
    assert np.linalg.norm(surface - exact_closest(mesh, surface)[0], axis=1).max() < chord
    assert is_closed(mesh)
    assert (mesh.face_vectors * body.normals(corners.mean(1))).sum(1).min() > 0
    assert not len(self_intersections(mesh))
    assert len(mesh.faces) < 60 * mesh.area / (chord * body.diameter)


@pytest.mark.parametrize("stock", STOCKS.values(), ids=STOCKS)
def test_walls_move_in_by_the_offset(stock):
    inner = stock.offset(-1.0)
    assert np.allclose(inner.bounds, stock.bounds + np.array([[1.0], [-1.0]]), atol=1e-6)
    assert inner.inradius == pytest.approx(stock.inradius - 1, abs=1e-6)


def ellipsoid(around: int) -> TriangleMesh:
    angle = np.linspace(0, np.pi, around // 2 + 2)[-2:0:-1]
    mesh = revolve(6.9 * np.sin(angle), 15.18 * np.cos(angle), (-15.18, 15.18), around)
    return TriangleMesh(mesh.vertices.astype(np.float32).astype(np.float64), mesh.faces)


def test_a_body_with_the_coordinates_of_an_stl_moves_in_to_a_closed_one():
    planes = half_spaces_of(ellipsoid(24))
    ConvexStock(intersect(planes + np.array([0.0, 0.0, 0.0, 1.72]), np.zeros(3)))


def edge_lengths(mesh: TriangleMesh) -> np.ndarray:
    corners = mesh.vertices[mesh.faces]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)


def test_the_core_of_a_mesh_of_many_faces_has_no_slivers_and_loses_little():
    stock = ConvexStock(ellipsoid(60))
    core, planes = stock.offset(-5.0), half_spaces_of(stock.surface) + np.array([0.0, 0.0, 0.0, 5.0])
    assert isinstance(core, ConvexStock)
    exact = intersect(planes, np.zeros(3))
    assert core.signed_distance(exact.vertices).max() < 0.01
    assert (planes[:, :3] @ core.surface.vertices.T + planes[:, 3:]).max() < 1e-6
    assert edge_lengths(core.surface).min() > 1e-3 > edge_lengths(exact).min()
    assert len(core.surface.faces) < len(exact.faces)
    ConvexStock(core.surface)


def test_the_mesh_of_a_mesh_has_edges_as_short_as_asked_and_few_more_faces():
    stock = ConvexStock(ellipsoid(24))
    mesh = stock.mesh(0.01)
    step = np.sqrt(8 * 0.01 * stock.diameter)
    assert edge_lengths(mesh).max() <= step < edge_lengths(stock.surface).max()
    assert len(mesh.faces) < 6 * mesh.area / step**2 + len(stock.surface.faces)
    assert np.abs(stock.signed_distance(mesh.vertices)).max() < 1e-6
    ConvexStock(mesh)


def test_a_bar_rounded_by_its_radius_is_the_published_capsule():
    body = BAR.round_edges(BAR.radius)
    assert isinstance(body, Capsule)
    assert (body.diameter, body.length) == (BAR.diameter, BAR.length)


def test_the_roundest_body_leaves_the_margin_over_the_part():
    points = np.array([[3.9, 3.4, 10.0], [0.0, 0.0, 19.5]])
    body = round_most(BOX, points, 0.3)
    assert isinstance(body, RoundedStock)
    assert body.signed_distance(points).max() == pytest.approx(-0.3, abs=0.01)
    assert round_most(BOX, np.array([[4.4, 3.9, 10.0]]), 0.09) is None


def test_the_roundest_body_leaves_room_for_levels_where_the_stock_has_it():
    """The stock has 0.5 mm over a place beside an edge, then 0.3 mm, of which half is left; in a corner
    hardly the margin."""
    for near, room in ((0.5, 0.25), (0.3, 0.15)):
        points = np.array([[4.5 - near, 2.6, 10.0], [0.0, 0.0, 19.5]])
        body = round_most(BOX, points, 0.05)
        assert isinstance(body, RoundedStock)
        assert body.signed_distance(points[:1]) == pytest.approx(-room, abs=0.001)
    tight = round_most(BOX, np.array([[4.34, 3.84, 10.0]]), 0.05)
    assert isinstance(tight, RoundedStock)
    assert tight.radius == pytest.approx(0.426, abs=0.001)


@pytest.mark.parametrize(
    "body", [BAR.round_edges(4.5), BAR.round_edges(2.0), BOX.round_edges(3.0)], ids=["capsule", "bar", "box"]
)
def test_the_spline_of_a_body_lies_on_it(body):
    surface = body_surfaces([body])[0]
    s, t = np.random.default_rng(4).random((2, 3000))
    points = surface.evaluate(s, t)
    assert isinstance(points, np.ndarray)
    assert np.abs(body.signed_distance(points)).max() < 0.002
    assert (surface.normals(s, t) * body.normals(points)).sum(1).min() > 0.999


@pytest.mark.parametrize(
    ("half", "radius"), [((13.3, 10.35, 32.4), 2.9), ((10.0, 10.0, 20.0), 1.0)], ids=["metatarsal", "sharp"]
)
def test_the_spline_of_a_large_box_with_sharp_edges_lies_on_it_and_turns_nowhere_over(half, radius):
    body = Box(-np.array(half), np.array(half)).round_edges(radius)
    surface = body_surfaces([body])[0]
    s, t = np.random.default_rng(4).random((2, 100_000))
    points = surface.positions(s, t)
    assert np.abs(body.signed_distance(points)).max() < TOLERANCE * 1.1
    assert (surface.normals(s, t) * body.normals(points)).sum(1).min() > 0.99


def test_a_spline_that_cannot_follow_its_body_is_refused_with_distance_and_place(monkeypatch):
    monkeypatch.setattr(open_morph, "MAX_TRIES", 1)
    body = RoundedStock(Box(np.full(3, -4.0), np.full(3, 4.0)), 0.005)
    with pytest.raises(LevelError, match=r"mm off it at \(.*\), more than 0\.002 mm: give a larger stock") as caught:
        body_surfaces([body])
    assert caught.value.evidence["distance"] > TOLERANCE
    assert abs(body.signed_distance(caught.value.evidence["place"][None])[0]) == pytest.approx(
        caught.value.evidence["distance"]
    )


@pytest.mark.parametrize("stock", STOCKS.values(), ids=STOCKS)
def test_the_enclosing_capsule_holds_the_stock(stock):
    assert enclosing_capsule(stock).signed_distance(stock.mesh(0.01).vertices).max() < 0


@pytest.fixture(scope="module")
def made():
    return levels_in(waisted(), BAR, SCHEDULE, chord_tolerance=0.05)


def test_rounding_levels_follow_the_morph_out_to_the_bar(made):
    assert [level.index for level in made.levels] == list(range(len(made.levels)))
    last = made.levels[-1]
    assert last.surface is None
    assert np.abs(BAR.signed_distance(last.mesh.vertices)).max() < 1e-9
    rounding = [level for level in made.levels if isinstance(level, RoundedLevel)]
    # the edge is (sqrt 2 - 1) 4.5 = 1.86 mm from the capsule: three cuts of 0.9, and the capsule itself
    assert len(rounding) == 3
    assert [level.limit for level in made.levels[-3:]] == [0.9] * 3
    assert made.lower_bound <= made.cuts


def test_the_fewest_cuts_count_from_the_part_itself_and_not_from_its_mesh(made):
    rim = BAR.mesh(0.02).vertices
    assert made.distance == pytest.approx(waisted().project(rim).distances.max(), abs=1e-6)


def test_rounding_levels_keep_depth_nesting_and_stock(made):
    for level in made.levels[1:]:
        assert level.depth_max <= level.limit + 0.002
        assert level.nesting_min >= -0.001
        assert level.outside <= 0.001
        assert level.measures.self_intersections == 0
        assert sum(level.measures.depth_shares) == pytest.approx(1.0, abs=0.03)
        assert np.flatnonzero(level.measures.depth_shares)[-1] >= BINS * (
            level.depth_max / level.limit - 0.15
        )  # the deepest places have a share
    depths = [level.depth_max for level in made.levels[-3:]]
    assert np.ptp(depths) < 0.02
    volumes = [level.mesh.volume for level in made.levels]
    assert (np.diff(volumes) > 0).all()


def test_a_mesh_of_the_stock_that_cuts_itself_is_found_and_refused():
    part, stock = waisted(), Capsule(np.array([0.0, 0.0, 4.5]), np.array([0.0, 0.0, 15.5]), 4.5)
    inner, mesh = MeasuredSurface(part, level_grid(part, [part.control_points], 0.05)), stock.mesh(0.05)
    assert measure_last_cut(inner, mesh, stock, 9.0).self_intersections == 0
    vertices = mesh.vertices.copy()
    vertices[np.argmax(vertices[:, 0])] -= [12.0, 0.0, 0.0]
    crossed = TriangleMesh(vertices, mesh.faces)
    found = measure_last_cut(inner, crossed, stock, 9.0)
    assert np.array_equal(found.crossing_faces, self_intersections(crossed))
    broken = violations(found, 9.0, crossed, nesting_tolerance=9.0, stock_tolerance=9.0)
    with pytest.raises(LevelError, match="level 3 cuts itself in") as caught:
        require_none(3, broken, crossed)
    assert caught.value.evidence["level"] == 3


def test_every_level_can_be_followed_on_the_parts_tmesh(made):
    assert {len(level.control_points) for level in machined_levels(made.levels)} == {waisted().tmesh.size}
    rounding = next(level for level in made.levels if isinstance(level, RoundedLevel))
    assert (
        np.abs(
            rounding.mesh.bounds - waisted().with_control_points(rounding.control_points).tessellate(0.02).bounds
        ).max()
        < 0.3
    )


def test_a_mesh_that_cannot_be_made_true_is_refused_with_its_place():
    body = RoundedStock(Box(np.full(3, -1.0), np.full(3, 1.0)), 0.001)
    with pytest.raises(StockError, match=r"no mesh of the rounded stock is within 0\.02 mm") as caught:
        body.mesh(0.02)
    assert np.abs(body.signed_distance(caught.value.evidence["place"][None])).max() < 1e-9


def test_a_part_that_leaves_the_bar_is_refused_at_once_with_its_place():
    with pytest.raises(StockError, match=r"cylinder 4\.00 x 20\.00 mm\) does not hold the part") as caught:
        levels_in(waisted(), Cylinder(2.0, 0.0, 20.0), SCHEDULE)
    assert caught.value.evidence["distance"] > 0
    assert caught.value.evidence["place"].shape == (3,)


def test_a_part_in_the_edges_of_a_bar_is_refused_at_once():
    diagonal = unit(np.array([[4.5, 4.0, 0.0]]))
    across = np.array([[-diagonal[0, 1], diagonal[0, 0], 0.0]])
    points = waisted().control_points
    flat = 2.24 * points[:, :1] * diagonal + 0.3 * points[:, 1:2] * across + points[:, 2:] * [0.0, 0.0, 1.0]
    part = waisted().with_control_points(flat)
    with pytest.raises(
        StockError, match=r"too near to the edges of the stock \(box 9\.00 x 8\.00 x 20\.00 mm\) at"
    ) as caught:
        levels_in(part, BOX, SCHEDULE)
    assert part.project(caught.value.evidence["place"][None]).distances[0] < 0.02


@pytest.mark.parametrize(
    ("box", "more"),
    [
        pytest.param(
            StockJob(kind="box", width=8.21, depth=8.44, length=17.98, turn_deg=45.0), 1, marks=pytest.mark.slow
        ),
        (StockJob(kind="box"), 2),  # the smallest: one cut less of a bound that is two less
    ],
)
def test_a_shared_bone_uses_the_depth_in_a_box_too(box, more, shared):
    job = Job(mesh=MeshJob(units="m"), stock=box)
    setup = place(prepare_part(shared / "meshes" / "bones" / "3distph_m.stl", job.mesh), job)
    made = make_levels(fit_surface(setup.part, job).surface, setup.stock, job)
    assert made.cuts <= made.lower_bound + more
    assert made.depth_used > 0.95
    assert all(level.certified is not False for level in made.levels[1:])
