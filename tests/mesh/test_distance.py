import numpy as np
import pytest
from mesh_bodies import ellipsoid, moved, solid

from bonecam.mesh import MeshDistance, exact_closest, self_intersections
from bonecam.mesh.distance import CHUNK, EXACT_CHUNK, lowest_between

FAR = (300.0, -200.0, 500.0)
POINTS = np.random.default_rng(1).normal(size=(400, 3)) * 9 + FAR


@pytest.fixture(scope="module")
def ball():
    return moved(ellipsoid(10, 10, 10, 60, 90), FAR)


def test_signed_distance_is_negative_inside_and_that_of_the_ball(ball):
    distance = MeshDistance(ball)
    true = np.linalg.norm(POINTS - FAR, axis=1) - 10
    assert np.abs(distance.signed(POINTS) - true).max() < 0.02
    assert (distance.inside(POINTS) == (distance.signed(POINTS) < 0)).all()
    assert np.allclose(distance.unsigned(POINTS), np.abs(distance.signed(POINTS)))


def test_only_points_that_may_be_inside_are_asked_for_that(ball):
    distance = MeshDistance(ball)
    true = distance.signed(POINTS)
    inside = true < 0
    assert inside.any()
    assert (distance.signed(POINTS, may_be_inside=inside) == true).all()
    assert (distance.signed(POINTS, may_be_inside=False) == np.abs(true)).all()


def test_bulk_and_exact_closest_points_agree_to_single_precision(ball):
    places, faces = MeshDistance(ball).closest(POINTS)
    exact, _ = exact_closest(ball, POINTS)
    ours, true = np.linalg.norm(places - POINTS, axis=1), np.linalg.norm(exact - POINTS, axis=1)
    assert np.abs(ours - true).max() < 1e-5
    assert ((faces >= 0) & (faces < len(ball.faces))).all()


def test_an_empty_mesh_is_refused():
    empty = solid(np.empty((0, 3)), np.empty((0, 3)))
    with pytest.raises(ValueError, match="no faces"):
        MeshDistance(empty)
    with pytest.raises(ValueError, match="no faces"):
        exact_closest(empty, POINTS)


def test_self_intersections_are_found_only_where_they_are(ball):
    assert len(self_intersections(ball)) == 0
    spiked = np.array(ball.vertices)
    spiked[np.argmax(spiked[:, 0])] -= [25, 0, 0]
    found = self_intersections(solid(spiked, ball.faces))
    assert len(found) >= 2
    assert (np.diff(found) > 0).all()


def test_a_distance_is_exact_below_what_is_wanted_and_that_elsewhere(ball):
    distance = MeshDistance(ball)
    true = distance.signed(POINTS)
    for wanted in (0.3, np.linspace(-1.0, 4.0, len(POINTS))):
        found = distance.signed(POINTS, wanted)
        below = true < np.maximum(wanted, 0.0)
        assert 0 < below.sum() < len(below)
        assert np.array_equal(found[below], true[below])
        assert np.array_equal(found[~below], np.maximum(np.broadcast_to(wanted, len(POINTS)), 0.0)[~below])


def test_a_lower_bound_is_less_than_the_distance_by_no_more_than_its_slack(ball):
    distance = MeshDistance(ball)
    true = distance.unsigned(POINTS)
    bounds = {slack: distance.lower_bound(POINTS, slack) for slack in (0.0, 0.02, 0.2)}
    np.testing.assert_array_equal(bounds[0.0], true)
    for slack, bound in bounds.items():
        assert (bound <= true).all()
        assert (bound * (1 + slack) >= true * (1 - 1e-12)).all()
    assert (bounds[0.2] < true).any()


@pytest.mark.parametrize("shape", ["ball", "flat ellipsoid", "three faces"])
def test_the_tree_finds_the_distances_of_the_exact_search(ball, shape):
    coarse = ellipsoid(5, 5, 5, 5, 6)
    meshes = {
        "ball": ball,
        "flat ellipsoid": ellipsoid(9, 3, 1, 7, 9),
        "three faces": solid(np.array(coarse.vertices), coarse.faces[:3]),
    }
    mesh = meshes[shape]
    points = np.random.default_rng(2).normal(size=(2000, 3)) * 6 + mesh.bounds.mean(0)
    exact = np.linalg.norm(exact_closest(mesh, points)[0] - points, axis=1)
    assert np.abs(MeshDistance(mesh).unsigned(points) - exact).max() < 1e-12


def test_a_triangle_without_area_is_as_far_as_its_edges():
    flat = solid(np.array([[0.0, 0, 0], [4, 0, 0], [2, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2], [1, 2, 3], [3, 3, 2]]))
    points = np.random.default_rng(3).normal(size=(500, 3)) * 3
    x = np.clip(points[:, 0], 0, 4)
    assert np.allclose(
        MeshDistance(flat).unsigned(points), np.hypot(points[:, 0] - x, np.hypot(points[:, 1], points[:, 2])), atol=1e-9
    )


def test_the_number_of_threads_changes_no_bit(ball, monkeypatch):
    points = np.random.default_rng(4).normal(size=(3 * CHUNK + 5, 3)) * 9 + FAR
    found = []
    for threads in (1, 2, 5):
        monkeypatch.setattr("os.sched_getaffinity", lambda _, count=threads: set(range(count)))
        found.append(MeshDistance(ball).unsigned(points))
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])


def test_where_a_search_begins_changes_no_bit_of_a_distance(ball):
    distance = MeshDistance(ball)
    points = np.tile(POINTS, (2 * EXACT_CHUNK // len(POINTS) + 1, 1))
    assert len(points) > 2 * EXACT_CHUNK
    alone = np.concatenate([distance.unsigned(point[None]) for point in POINTS])
    assert (distance.unsigned(points) == np.tile(alone, len(points) // len(POINTS))).all()


def test_a_way_without_length_is_bounded_by_its_ends():
    near, far = np.array([2.0, 0.0, 1.0]), np.array([2.0, 1e3, 1.0])
    assert lowest_between(near, far, np.array([0.0, 1e3, 2.0])).tolist() == [2.0, 0.0, 0.0]
