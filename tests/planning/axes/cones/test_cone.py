"""The cone as a NURBS surface, its implicit form, its principal angles and its meshes."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from bonecam.planning.axes.cones import CIRCLE_KNOTS, ObliqueEllipticCone


def cone_of(*vectors: list[float]) -> ObliqueEllipticCone:
    return ObliqueEllipticCone(*np.array(vectors, dtype=float))


CONE = cone_of([1.0, 2.0, 3.0], [0.8, -0.5, 5.0], [2.0, 0.3, 0.1], [-0.4, 1.1, 0.6])
RANDOM = np.random.default_rng(7)


def angles(directions: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return np.arccos(np.clip(directions @ axis / np.linalg.norm(directions, axis=1) / np.linalg.norm(axis), -1, 1))


def test_the_nurbs_surface_lies_on_its_quadric() -> None:
    u, v = RANDOM.random((2, 2000))
    points = CONE.evaluate(u, v)
    assert np.abs(CONE.implicit(points)).max() < 1e-12
    np.testing.assert_allclose(CONE.heights(points), u, atol=1e-12)


def test_unit_weights_as_printed_miss_the_cone() -> None:
    """Eq. 16 without its rational part: a B-spline of the same net."""
    v = RANDOM.random(200)
    around = BSpline(CIRCLE_KNOTS, CONE.control_points[2], 2)(v)
    assert np.abs(CONE.implicit(around)).max() > 0.05


def test_the_gradient_is_that_of_the_implicit_form() -> None:
    points = RANDOM.normal(size=(50, 3)) * 4
    for axis in np.eye(3):
        change = CONE.implicit(points + 1e-6 * axis) - CONE.implicit(points - 1e-6 * axis)
        np.testing.assert_allclose(CONE.gradient(points) @ axis, change / 2e-6, rtol=1e-6, atol=1e-6)


def test_directions_inside_are_those_within_the_elliptic_section() -> None:
    x, y = RANDOM.uniform(-1.5, 1.5, (2, 5000))
    directions = CONE.axis + x[:, None] * CONE.first + y[:, None] * CONE.second
    np.testing.assert_array_equal(CONE.contains(directions), x**2 + y**2 <= 1)
    assert not CONE.contains(-directions).any()


def test_principal_angles_of_a_right_cone_are_its_own() -> None:
    cone = cone_of([0, 0, 0], [0, 0, 4.0], [3.0, 0, 0], [0, 1.0, 0])
    axes, semi_angles = cone.principal
    np.testing.assert_allclose(axes[0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(np.abs(axes[1]), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(semi_angles, np.arctan([0.75, 0.25]), rtol=1e-12)


def test_an_oblique_cone_is_the_right_cone_of_its_principal_angles() -> None:
    axes, (wide, narrow) = CONE.principal
    right = ObliqueEllipticCone(CONE.apex, axes[0], np.tan(wide) * axes[1], np.tan(narrow) * axes[2])
    directions = RANDOM.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_array_equal(CONE.contains(directions), right.contains(directions))
    assert wide >= narrow
    assert angles(CONE.axis[None], axes[0])[0] > 0.01  # it is oblique


@pytest.mark.parametrize("sides", [3, 48])
def test_meshes_hold_the_cone_or_lie_in_it(sides: int) -> None:
    outer, inner = (CONE.tessellate(sides, circumscribed=way) for way in (True, False))
    u, v = RANDOM.random((2, 20_000))
    samples = CONE.evaluate(u, v)
    for mesh in (outer, inner):
        assert mesh.volume > 0
        edges = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        assert {tuple(edge) for edge in edges.tolist()} == {tuple(edge[::-1]) for edge in edges.tolist()}
    normals = outer.face_vectors / np.linalg.norm(outer.face_vectors, axis=1, keepdims=True)
    beyond = np.einsum("fk,nfk->nf", normals, samples[:, None] - outer.vertices[outer.faces[:, 0]])
    assert beyond.max() < 1e-12
    assert CONE.implicit(inner.vertices[2:]).max() < 1e-12
    assert inner.volume < np.pi / 3 * abs(np.linalg.det([CONE.axis, CONE.first, CONE.second])) < outer.volume


def test_what_is_no_cone_is_refused() -> None:
    with pytest.raises(ValueError, match="no cone"):
        cone_of([0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0])
    with pytest.raises(ValueError, match="no cone"):
        cone_of([0, 0, 0], [0, 0, 1], [0, 0, 0], [0, 1, 0])
    with pytest.raises(ValueError, match=r"apex = .* three finite numbers"):
        cone_of([0, 0, np.nan], [0, 0, 1], [1, 0, 0], [0, 1, 0])
    with pytest.raises(ValueError, match="3 or more"):
        CONE.tessellate(2, circumscribed=True)
