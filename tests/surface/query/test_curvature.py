"""Curvature, area and volume against shapes whose values are known."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline


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


def test_a_ball_has_positive_curvature_one_over_its_radius(samples: Callable[..., tuple[ndarray, ndarray]]) -> None:
    surface = ball(4.0)
    s, t = samples(2000)
    found = surface.curvature(s, 0.05 + 0.9 * t)
    for k in (found.k1, found.k2, found.mean):
        np.testing.assert_allclose(k, 0.25, rtol=0.02)
    np.testing.assert_allclose(found.gaussian, 1 / 16, rtol=0.03)
    assert (found.k1 >= found.k2).all()
    assert surface.area == pytest.approx(4 * np.pi * 16, rel=1e-4)
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 64, rel=1e-4)


def test_the_poles_of_a_ball_have_the_limit_curvature() -> None:
    poles = ball(4.0).curvature(np.array([0.0, 0.3, 0.9]), np.array([0.0, 1.0, 0.5]))
    np.testing.assert_allclose(poles.k1, 0.25, rtol=0.05)
    np.testing.assert_allclose(poles.k2, 0.25, rtol=0.05)
    np.testing.assert_allclose(np.abs(poles.direction1[:2, 2]), 0, atol=1e-6)


def test_directions_are_principal(
    bone_like: Callable[..., TSpline], samples: Callable[..., tuple[ndarray, ndarray]]
) -> None:
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


def test_a_pole_without_a_tangent_plane_is_an_error(bone_like: Callable[..., TSpline]) -> None:
    surface = bone_like(9, 7)
    points = surface.control_points.copy()
    points[1:8] = points[0]
    with pytest.raises(SurfaceError, match="no normal"):
        surface.with_control_points(points).normals(np.zeros(1), np.zeros(1))
