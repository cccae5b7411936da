"""Projection: the feet are feet, and no part of the surface is nearer.

Curvature, area and volume against shapes whose values are known.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree
from tsplines import bone_like, samples

from bonecam.errors import SurfaceError
from bonecam.surface import RowTMesh, TSpline


def offset_points(seed: int, count: int) -> tuple[TSpline, np.ndarray]:
    surface = bone_like(19, 15, seed)
    s, t = samples(count, seed)
    t[: count // 10] *= 0.02
    t[-count // 10 :] = 1 - 0.02 * t[-count // 10 :]
    points = surface.evaluate(s, t) + surface.normals(s, t) * np.random.default_rng(seed).uniform(-1, 1, (count, 1))
    return surface, points


@settings(max_examples=6)
@given(st.integers(0, 10_000))
def test_feet_are_orthogonal_and_at_their_parameters(seed):
    surface, points = offset_points(seed, 1000)
    found = surface.project(points)
    S, S_s, S_t = surface.evaluate(found.s, found.t, 1)
    np.testing.assert_allclose(S, found.points, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(points - S, axis=1), found.distances, atol=1e-12)
    inner = (found.t > 1e-6) & (found.t < 1 - 1e-6)
    for D in (S_s, S_t):
        sine = np.abs(np.einsum("ni,ni->n", points - S, D)) / np.linalg.norm(D, axis=1)
        assert np.quantile(sine[inner], 0.995) <= 1e-8


def test_no_sample_of_the_surface_is_nearer_than_the_foot():
    surface, points = offset_points(0, 5000)
    s, t = (v.ravel() for v in np.meshgrid(np.arange(600) / 600, np.linspace(0, 1, 600)))
    nearest = KDTree(surface.evaluate(s, t)).query(points)[0]
    assert (surface.project(points).distances - nearest).max() <= 1e-6


def test_points_on_the_surface_seam_and_poles_come_home():
    surface = bone_like(14, 11, 3)
    s, t = samples(2000)
    s[:200], t[200:220], t[220:240] = 0.0, 0.0, 1.0
    points = surface.evaluate(s, t)
    parameters, feet, distances = surface.project(points)
    assert distances.max() <= 1e-8
    np.testing.assert_allclose(feet, points, atol=1e-8)
    away = (t > 0.05) & (t < 0.95)
    np.testing.assert_allclose((parameters[away, 0] - s[away] + 0.5) % 1, 0.5, atol=1e-8)


def test_points_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="point 1"):
        bone_like(8, 6).project(np.array([[0.0, 0, 0], [0, np.nan, 0]]))


def ball(radius: float, rows: int = 24, around: int = 32) -> TSpline:
    """A cubic approximation of a ball by interpolation at as many points as it has control points."""
    t_knots = np.concatenate([[0.0] * 4, np.linspace(0, 1, rows - 2)[1:-1], [1.0] * 4])
    mesh = RowTMesh.from_rows(t_knots, [np.zeros(1), *[np.arange(around) / around] * (rows - 2), np.zeros(1)])
    flat = TSpline(mesh, np.zeros((mesh.size, 3)), np.ones(mesh.size))
    greville = np.array([t_knots[j + 1 : j + 4].mean() for j in range(rows)])
    s = np.concatenate([[0.0], np.tile(np.arange(around) / around, rows - 2), [0.0]])
    t = np.concatenate([[0.0], np.repeat(greville[1:-1], around), [1.0]])
    polar = np.pi * t
    points = radius * np.column_stack(
        [np.sin(polar) * np.cos(2 * np.pi * s), np.sin(polar) * np.sin(2 * np.pi * s), -np.cos(polar)]
    )
    return flat.with_control_points(np.linalg.solve(flat.basis(s, t)[0].toarray(), points))


def test_a_ball_has_positive_curvature_one_over_its_radius():
    surface = ball(4.0)
    s, t = samples(2000)
    found = surface.curvature(s, 0.05 + 0.9 * t)
    for k in (found.k1, found.k2, found.mean):
        np.testing.assert_allclose(k, 0.25, rtol=0.02)
    np.testing.assert_allclose(found.gaussian, 1 / 16, rtol=0.03)
    assert (found.k1 >= found.k2).all()
    assert surface.area == pytest.approx(4 * np.pi * 16, rel=1e-4)
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 64, rel=1e-4)


def test_the_poles_of_a_ball_have_the_limit_curvature():
    poles = ball(4.0).curvature(np.array([0.0, 0.3, 0.9]), np.array([0.0, 1.0, 0.5]))
    np.testing.assert_allclose(poles.k1, 0.25, rtol=0.05)
    np.testing.assert_allclose(poles.k2, 0.25, rtol=0.05)
    np.testing.assert_allclose(np.abs(poles.direction1[:2, 2]), 0, atol=1e-6)


def test_directions_are_principal():
    surface = bone_like(14, 12, 2)
    s, t = samples(300)
    t = 0.05 + 0.9 * t
    found, normals = surface.curvature(s, t), surface.normals(s, t)
    np.testing.assert_allclose(np.einsum("ni,ni->n", found.direction1, found.direction2), 0, atol=1e-10)
    h = 1e-5
    for k, d in ((found.k1, found.direction1), (found.k2, found.direction2)):
        _, S_s, S_t = surface.evaluate(s, t, 1)
        step = (
            np.array([np.linalg.lstsq(np.column_stack([a, b]), v, rcond=None)[0] for a, b, v in zip(S_s, S_t, d)]) * h
        )
        change = (surface.normals(s + step[:, 0], t + step[:, 1]) - surface.normals(s - step[:, 0], t - step[:, 1])) / (
            2 * h
        )
        np.testing.assert_allclose(change, k[:, None] * d, atol=2e-3 * np.abs(found.k1).max())
    np.testing.assert_allclose(np.cross(found.direction1, found.direction2), normals * np.sign(
        np.einsum("ni,ni->n", np.cross(found.direction1, found.direction2), normals))[:, None], atol=1e-9)  # fmt: skip


def test_a_pole_without_a_tangent_plane_is_an_error():
    surface = bone_like(9, 7)
    points = surface.control_points.copy()
    points[1:8] = points[0]
    with pytest.raises(SurfaceError, match="no normal"):
        surface.with_control_points(points).normals(np.zeros(1), np.zeros(1))
