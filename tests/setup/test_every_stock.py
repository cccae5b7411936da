"""Every stock answers the same questions: exact distances, nearest points, a closed even mesh, and refuses
what is no body."""

import numpy as np
import pytest

from bonecam.errors import StockError
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.capsule import Capsule
from bonecam.setup.stock import Stock, stock_figures, stock_text
from bonecam.setup.stocks.box import Box
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.setup.stocks.mesh import ConvexStock

BOX = Box(np.array([-6.0, -7.5, 3.0]), np.array([6.0, 7.5, 40.0]))
CYLINDER = Cylinder(7.5, 3.0, 40.0)
BODIES: dict[str, Stock] = {
    "capsule": Capsule(np.array([0, 0, 10.5]), np.array([0, 0, 32.5]), 7.5),
    "cylinder": CYLINDER,
    "box": BOX,
    "mesh": ConvexStock(BOX.mesh(2.0)),
    "prism": ConvexStock(Cylinder(7.0, 0.0, 30.0).mesh(2.0)),
}


@pytest.fixture(params=BODIES, name="body")
def each_body(request: pytest.FixtureRequest) -> Stock:
    return BODIES[request.param]


def cloud(count: int = 500) -> np.ndarray:
    return np.random.default_rng(5).uniform([-14, -14, -8], [14, 14, 50], (count, 3))


def test_nearest_points_lie_on_the_surface_at_the_signed_distance(body: Stock) -> None:
    points = cloud()
    distance, nearest = body.signed_distance(points), body.closest_points(points)
    assert isinstance(body, Stock)
    assert np.abs(body.signed_distance(nearest)).max() < 1e-9
    assert np.allclose(np.linalg.norm(points - nearest, axis=1), np.abs(distance), atol=1e-9)
    assert np.allclose(nearest + distance[:, None] * body.normals(points), points, atol=1e-9)


def test_distances_agree_with_the_mesh(body: Stock) -> None:
    points = cloud()
    closest, _ = exact_closest(body.mesh(0.002), points)
    assert np.allclose(np.linalg.norm(points - closest, axis=1), np.abs(body.signed_distance(points)), atol=0.004)


def test_no_planes_of_nearest_points_cut_the_body(body: Stock) -> None:
    points = cloud(200)
    normals, touch, probes = body.normals(points), body.closest_points(points), body.mesh(0.05).vertices
    assert np.allclose(np.linalg.norm(normals, axis=1), 1)
    assert (probes @ normals.T - (normals * touch).sum(1)).max() < 1e-9


def test_the_mesh_is_closed_outward_and_on_the_surface(body: Stock) -> None:
    mesh = body.mesh(0.02)
    edges = np.sort(np.vstack([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    assert np.abs(body.signed_distance(mesh.vertices)).max() < 1e-9
    assert np.abs(body.signed_distance(mesh.vertices[mesh.faces].mean(1))).max() < 0.02
    assert np.linalg.norm(mesh.face_vectors, axis=1).min() > 0
    assert np.allclose(mesh.bounds, body.bounds, atol=0.05)
    assert mesh.volume > 0


def test_a_moved_body_is_the_same_elsewhere(body: Stock) -> None:
    shift, points = np.array([1.0, -2.0, 3.0]), cloud(50)
    moved = body.move(shift)
    assert np.allclose(moved.signed_distance(points + shift), body.signed_distance(points), atol=1e-9)
    assert (moved.kind, moved.diameter, moved.length) == pytest.approx((body.kind, body.diameter, body.length))


SIZES = {
    "capsule": {"diameter": 15.0, "length": 37.0},
    "cylinder": {"diameter": 15.0, "length": 37.0},
    "box": {"width": 12.0, "depth": 15.0, "length": 37.0},
    "mesh": {"width": 12.0, "depth": 15.0, "length": 37.0},
}


@pytest.mark.parametrize("kind", SIZES)
def test_a_stock_is_described_by_its_own_sizes(kind: str) -> None:
    assert stock_figures(BODIES[kind]) == {"kind": kind, **{f"{name}_mm": size for name, size in SIZES[kind].items()}}
    assert (
        stock_text(stock_figures(BODIES[kind]))
        == f"{kind} {' x '.join(f'{size:.2f}' for size in SIZES[kind].values())} mm"
    )


def test_a_mesh_that_is_not_convex_is_refused_with_distance_and_place() -> None:
    mesh = Box(np.zeros(3), np.full(3, 10.0)).mesh(2.0)
    vertices = mesh.vertices.copy()
    middle = int(np.argmin(np.linalg.norm(vertices - [5, 5, 10], axis=1)))
    vertices[middle, 2] -= 1.0
    with pytest.raises(StockError, match="not convex: it lies 1") as caught:
        ConvexStock(TriangleMesh(vertices, mesh.faces))
    assert caught.value.evidence["distance"] == pytest.approx(1.0)
    assert caught.value.evidence["place"][2] == pytest.approx(9.0)


def test_a_mesh_in_absurd_units_is_refused() -> None:
    mesh = Box(np.zeros(3), np.full(3, 10.0)).mesh(2.0)
    for made in (
        lambda: ConvexStock(TriangleMesh(1e6 * mesh.vertices, mesh.faces)),
        lambda: ConvexStock(mesh).scale(2e6),
    ):
        with pytest.raises(StockError, match=r"reaches 1e\+07 mm from the origin: give one in mm"):
            made()


def test_two_bodies_are_not_one_convex_body() -> None:
    mesh = Box(np.zeros(3), np.ones(3)).mesh(1.0)
    two = TriangleMesh(
        np.vstack([mesh.vertices, mesh.vertices + 3]), np.vstack([mesh.faces, mesh.faces + len(mesh.vertices)])
    )
    with pytest.raises(StockError, match="not convex"):
        ConvexStock(two)


def test_a_body_twice_in_one_mesh_is_told_by_its_volume() -> None:
    mesh = Box(np.zeros(3), np.ones(3)).mesh(1.0)
    twice = TriangleMesh(
        np.vstack([mesh.vertices, mesh.vertices]), np.vstack([mesh.faces, mesh.faces + len(mesh.vertices)])
    )
    with pytest.raises(
        StockError, match=r"no single convex body: its faces hold 2\.0 mm3, their convex hull 1\.0: give the hull$"
    ):
        ConvexStock(twice)


def test_vertices_without_faces_are_no_part_of_a_body() -> None:
    mesh = BOX.mesh(1.0)
    stock = ConvexStock(TriangleMesh(np.vstack([BOX.middle, [99.0, 0, 0], mesh.vertices]), mesh.faces + 2))
    assert np.array_equal(stock.bounds, BOX.bounds)


def test_an_open_mesh_is_refused() -> None:
    mesh = BOX.mesh(1.0)
    with pytest.raises(StockError, match="not closed at"):
        ConvexStock(TriangleMesh(mesh.vertices, mesh.faces[1:]))


def test_a_mesh_inside_out_is_refused() -> None:
    mesh = BOX.mesh(1.0)
    with pytest.raises(StockError, match="inside out"):
        ConvexStock(TriangleMesh(mesh.vertices, mesh.faces[:, ::-1]))


@pytest.mark.parametrize("thickness", [0.0, 1e-6, -1e-6])
def test_a_flat_mesh_is_refused_as_that(thickness: float) -> None:
    mesh = BOX.mesh(1.0)
    with pytest.raises(StockError, match="is flat and holds nothing: give a solid body"):
        ConvexStock(TriangleMesh(mesh.vertices * [1.0, 1.0, thickness], mesh.faces))


@pytest.mark.parametrize(
    "make",
    [lambda: Cylinder(0.0, 0.0, 1.0), lambda: Cylinder(1.0, 2.0, 1.0), lambda: Box(np.zeros(3), np.array([1.0, 1, 0]))],
)
def test_a_bar_without_extent_is_refused(make: object) -> None:
    with pytest.raises(StockError, match="positive"):
        make()  # type: ignore[operator]
