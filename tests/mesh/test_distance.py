import numpy as np
import pytest
from solids import ellipsoid, moved, solid

from bonecam.mesh.distance import CHUNK, MeshDistance, exact_closest, lowest_between
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh

FAR = (300.0, -200.0, 500.0)
BALL = moved(ellipsoid(10, 10, 10, 60, 90), FAR)
POINTS = np.random.default_rng(1).normal(size=(400, 3)) * 9 + FAR


def test_signed_distance_is_negative_inside_and_that_of_the_ball() -> None:
    distance = MeshDistance(BALL)
    true = np.linalg.norm(POINTS - FAR, axis=1) - 10
    assert np.abs(distance.signed(POINTS) - true).max() < 0.02
    assert (distance.inside(POINTS) == (distance.signed(POINTS) < 0)).all()
    assert np.allclose(distance.unsigned(POINTS), np.abs(distance.signed(POINTS)))


def test_bulk_and_exact_closest_points_agree_to_single_precision() -> None:
    places, faces = MeshDistance(BALL).closest(POINTS)
    exact, _ = exact_closest(BALL, POINTS)
    ours, true = np.linalg.norm(places - POINTS, axis=1), np.linalg.norm(exact - POINTS, axis=1)
    assert np.abs(ours - true).max() < 1e-5
    assert ((faces >= 0) & (faces < len(BALL.faces))).all()


def test_an_empty_mesh_is_refused() -> None:
    empty = solid(np.empty((0, 3)), np.empty((0, 3)))
    with pytest.raises(ValueError, match="no faces"):
        MeshDistance(empty)
    with pytest.raises(ValueError, match="no faces"):
        exact_closest(empty, POINTS)


def test_self_intersections_are_found_only_where_they_are() -> None:
    assert len(self_intersections(BALL)) == 0
    spiked = np.array(BALL.vertices)
    spiked[np.argmax(spiked[:, 0])] -= [25, 0, 0]
    found = self_intersections(solid(spiked, BALL.faces))
    assert len(found) >= 2
    assert (np.diff(found) > 0).all()


def test_a_distance_is_exact_below_what_is_wanted_and_that_elsewhere() -> None:
    distance = MeshDistance(BALL)
    true = distance.signed(POINTS)
    for wanted in (0.3, np.linspace(-1.0, 4.0, len(POINTS))):
        found = distance.signed(POINTS, wanted)
        below = true < np.maximum(wanted, 0.0)
        assert 0 < below.sum() < len(below)
        assert np.array_equal(found[below], true[below])
        assert np.array_equal(found[~below], np.maximum(np.broadcast_to(wanted, len(POINTS)), 0.0)[~below])


@pytest.mark.parametrize(
    "mesh",
    [
        BALL,
        ellipsoid(9, 3, 1, 7, 9),
        solid(np.array(ellipsoid(5, 5, 5, 5, 6).vertices), ellipsoid(5, 5, 5, 5, 6).faces[:3]),
    ],
)
def test_the_tree_finds_the_distances_of_the_exact_search(mesh: TriangleMesh) -> None:
    points = np.random.default_rng(2).normal(size=(2000, 3)) * 6 + mesh.bounds.mean(0)
    exact = np.linalg.norm(exact_closest(mesh, points)[0] - points, axis=1)
    assert np.abs(MeshDistance(mesh).unsigned(points) - exact).max() < 1e-12


def test_a_triangle_without_area_is_as_far_as_its_edges() -> None:
    flat = solid(
        np.array([[0.0, 0, 0], [4, 0, 0], [2, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2], [1, 2, 3], [3, 3, 2]])
    )
    points = np.random.default_rng(3).normal(size=(500, 3)) * 3
    x = np.clip(points[:, 0], 0, 4)
    assert np.allclose(
        MeshDistance(flat).unsigned(points),
        np.hypot(points[:, 0] - x, np.hypot(points[:, 1], points[:, 2])),
        atol=1e-9,
    )


def test_the_number_of_threads_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(4).normal(size=(3 * CHUNK + 5, 3)) * 9 + FAR
    found = []
    for threads in (1, 2, 5):
        monkeypatch.setattr("os.sched_getaffinity", lambda _, count=threads: set(range(count)))
        found.append(MeshDistance(BALL).unsigned(points))
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])


def test_a_way_without_length_is_bounded_by_its_ends() -> None:
    near, far = np.array([2.0, 0.0, 1.0]), np.array([2.0, 1e3, 1.0])
    assert lowest_between(near, far, np.array([0.0, 1e3, 2.0])).tolist() == [2.0, 0.0, 0.0]
