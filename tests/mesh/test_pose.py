""""""

import numpy as np
import pytest
from mesh_bodies import ellipsoid, solid, torus

from bonecam.errors import MeshError
from bonecam.mesh import upright
from bonecam.mesh.pose import enclosing_circle, solid_moments

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TURN = TURN * np.sign(np.linalg.det(TURN))


@pytest.fixture(scope="module")
def pear():
    return ellipsoid(5, 3, 14, thick_end=0.3)


def test_any_pose_ends_upright_with_the_thick_end_down(pear):
    placed = solid(pear.vertices @ TURN.T + [100, -50, 7], pear.faces)
    mesh, transform = upright(placed)
    assert np.allclose(placed.vertices @ transform[:3, :3].T + transform[:3, 3], mesh.vertices, atol=1e-9)
    assert np.allclose(transform[:3, :3] @ transform[:3, :3].T, np.eye(3))
    assert np.linalg.det(transform[:3, :3]) == pytest.approx(1)
    assert np.allclose(np.ptp(mesh.vertices, axis=0), np.ptp(pear.vertices, axis=0), atol=1e-6)
    assert mesh.bounds[0, 2] == pytest.approx(0)
    assert solid_moments(mesh)[0][2] < 14
    assert np.allclose(enclosing_circle(mesh.vertices[:, :2])[0], 0, atol=1e-9)


def test_an_upright_mesh_stays(pear):
    once, _ = upright(pear)
    twice, transform = upright(once)
    assert np.allclose(transform, np.eye(4), atol=1e-9)
    assert np.allclose(once.vertices, twice.vertices)


def test_moments_are_those_of_the_ellipsoid():
    centroid, covariance = solid_moments(ellipsoid(5, 3, 14, 80, 80))
    assert np.allclose(centroid, 0, atol=1e-9)
    assert np.allclose(covariance, np.diag([25, 9, 196]) / 5, rtol=0.02, atol=1e-9)


def test_the_circle_touches_and_holds_all_points():
    points = np.random.default_rng(5).normal(size=(500, 2)) * [3, 1]
    centre, radius = enclosing_circle(points)
    distances = np.linalg.norm(points - centre, axis=1)
    assert distances.max() == pytest.approx(radius)
    touching = points[distances > radius * (1 - 1e-9)] - centre
    angles = np.sort(np.arctan2(touching[:, 1], touching[:, 0]))
    assert np.diff(np.append(angles, angles[0] + 2 * np.pi)).max() <= np.pi + 1e-6, "no smaller circle holds them"


def test_an_inside_out_mesh_has_no_pose():
    mesh = torus()
    with pytest.raises(MeshError, match="outwards"):
        upright(solid(mesh.vertices, mesh.faces[:, ::-1]))


@pytest.mark.parametrize("seed", range(20))
def test_the_circle_round_nearly_regular_points_is_found(seed):
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * np.arange(24) / 24
    points = 5.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    points += 10.0 ** -rng.integers(6, 12) * rng.normal(size=points.shape)
    centre, radius = enclosing_circle(points)
    assert np.linalg.norm(points - centre, axis=1).max() <= radius * (1 + 1e-12)
    assert radius == pytest.approx(5.0, abs=1e-5)
    assert np.linalg.norm(centre) < 1e-3
