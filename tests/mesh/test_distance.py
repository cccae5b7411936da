import numpy as np
import pytest
from solids import ellipsoid, moved, solid

from bonecam.mesh.distance import LayeredDistance, MeshDistance, exact_closest
from bonecam.mesh.intersections import self_intersections

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


def test_a_layered_distance_is_a_lower_bound_and_exact_where_it_is_close() -> None:
    coarse = moved(ellipsoid(10, 10, 10, 12, 18), FAR)
    layered, exact = LayeredDistance(BALL, coarse, 0.6), MeshDistance(BALL)
    found, true = layered.signed(POINTS, 0.3), exact.signed(POINTS)
    assert (found <= true + 1e-6).all()
    close = true < 0.3
    assert 0 < close.sum() < len(close)
    assert np.allclose(found[close], true[close], atol=1e-6)
