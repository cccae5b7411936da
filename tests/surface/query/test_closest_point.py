"""Projection: the feet are feet, and no part of the surface is nearer."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.surface.tspline import TSpline


def offset_points(
    bone_like: Callable[..., TSpline], samples: Callable[..., tuple[ndarray, ndarray]], seed: int, count: int
) -> tuple[TSpline, np.ndarray]:
    surface = bone_like(19, 15, seed)
    s, t = samples(count, seed)
    t[: count // 10] *= 0.02
    t[-count // 10 :] = 1 - 0.02 * t[-count // 10 :]
    points = surface.evaluate(s, t) + surface.normals(s, t) * np.random.default_rng(seed).uniform(-1, 1, (count, 1))
    return surface, points


@settings(max_examples=6)
@given(st.integers(0, 10_000))
def test_feet_are_orthogonal_and_at_their_parameters(
    bone_like: Callable[..., TSpline], samples: Callable[..., tuple[ndarray, ndarray]], seed: int
) -> None:
    surface, points = offset_points(bone_like, samples, seed, 1000)
    found = surface.project(points)
    S, S_s, S_t = surface.evaluate(found.s, found.t, 1)
    np.testing.assert_allclose(S, found.points, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(points - S, axis=1), found.distances, atol=1e-12)
    inner = (found.t > 1e-6) & (found.t < 1 - 1e-6)
    for D in (S_s, S_t):
        sine = np.abs(np.einsum("ni,ni->n", points - S, D)) / np.linalg.norm(D, axis=1)
        assert np.quantile(sine[inner], 0.995) <= 1e-8


def test_no_sample_of_the_surface_is_nearer_than_the_foot(
    bone_like: Callable[..., TSpline], samples: Callable[..., tuple[ndarray, ndarray]]
) -> None:
    surface, points = offset_points(bone_like, samples, 0, 5000)
    s, t = (v.ravel() for v in np.meshgrid(np.arange(600) / 600, np.linspace(0, 1, 600)))
    nearest = KDTree(surface.evaluate(s, t)).query(points)[0]
    assert (surface.project(points).distances - nearest).max() <= 1e-6


def test_points_on_the_surface_seam_and_poles_come_home(
    bone_like: Callable[..., TSpline], samples: Callable[..., tuple[ndarray, ndarray]]
) -> None:
    surface = bone_like(14, 11, 3)
    s, t = samples(2000)
    s[:200], t[200:220], t[220:240] = 0.0, 0.0, 1.0
    points = surface.evaluate(s, t)
    parameters, feet, distances = surface.project(points)
    assert distances.max() <= 1e-8
    np.testing.assert_allclose(feet, points, atol=1e-8)
    away = (t > 0.05) & (t < 0.95)
    np.testing.assert_allclose((parameters[away, 0] - s[away] + 0.5) % 1, 0.5, atol=1e-8)


def test_points_above_the_poles_have_their_feet_there(bone_like: Callable[..., TSpline]) -> None:
    surface = bone_like(14, 12, 1, spread=0.0)
    low, high = surface.control_points[[0, -1]]
    found = surface.project(np.array([low, high]) + np.array([[0, 0, -1.5], [0, 0, 1.5]]))
    np.testing.assert_allclose(found.distances, 1.5, atol=1e-3)
    assert (found.distances <= 1.5 + 1e-12).all()


def test_points_that_are_not_finite_are_refused(bone_like: Callable[..., TSpline]) -> None:
    with pytest.raises(ValueError, match="point 1"):
        bone_like(8, 6).project(np.array([[0.0, 0, 0], [0, np.nan, 0]]))
