"""Deviation: measured both ways, against shapes whose distance is known."""

import numpy as np
import pytest

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.fitting import deviation, sample_mesh
from bonecam.surface.skinning import skin
from bonecam.surface.tspline import TSpline

POLES = np.array([[0.0, 0.0, -2.0], [0.0, 0.0, 2.0]])


@pytest.fixture(scope="module")
def ball() -> TSpline:
    t, s = np.meshgrid(np.pi * np.arange(1, 16) / 16, 2 * np.pi * np.arange(40) / 40, indexing="ij")
    points = 2 * np.stack([np.sin(t) * np.cos(s), np.sin(t) * np.sin(s), -np.cos(t)], axis=2)
    return skin(points, 1e-4, poles=POLES)


def test_a_surface_deviates_from_its_own_tessellation_by_the_chord_only(ball: TSpline) -> None:
    found = deviation(ball, ball.tessellate(0.005), 4000)
    assert found.max < 0.0075
    assert found.rms <= found.max


def test_a_larger_ball_is_measured_both_ways(ball: TSpline) -> None:
    mesh = ball.tessellate(0.002)
    found = deviation(ball, TriangleMesh(mesh.vertices * 1.1, mesh.faces), 4000)
    assert found.surface_to_mesh_max == pytest.approx(0.2, abs=0.005)
    assert found.mesh_to_surface_max == pytest.approx(0.2, abs=0.005)


def test_a_spike_of_the_mesh_is_seen_from_the_mesh_and_named(ball: TSpline) -> None:
    mesh = ball.tessellate(0.01)
    vertices = mesh.vertices.copy()
    tip = int(np.argmax(vertices[:, 0]))
    vertices[tip] *= 1.25
    found = deviation(ball, TriangleMesh(vertices, mesh.faces), 4000)
    assert found.max == found.mesh_to_surface_max == pytest.approx(0.5, abs=0.01)
    assert np.allclose(found.place, vertices[tip])


def test_the_samples_carry_the_area_of_the_mesh(ball: TSpline) -> None:
    mesh = ball.tessellate(0.02)
    points, areas = sample_mesh(mesh, 3000)
    assert areas.sum() == pytest.approx(mesh.area)
    assert np.array_equal(points[: len(mesh.vertices)], mesh.vertices)
    assert len(points) > 2500
