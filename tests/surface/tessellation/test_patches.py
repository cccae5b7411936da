"""Tessellation and projection of general T-splines: conforming, within tolerance, nearest feet beside notches
and borders."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy import ndarray
from rows_to_general import as_general

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.files.tspline_text import read_tsm
from bonecam.surface.tspline import TSpline

igl = pytest.importorskip("igl")
MODELS = ("simple", "fan", "Bike", "mouse", "face", "gearbox2-9")


def border(mesh: TriangleMesh) -> np.ndarray:
    """Vertex pairs of the edges with one face; no edge may have more than two."""
    edges = np.sort(np.vstack([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() <= 2
    return unique[count == 1]


def assert_within(
    inner_samples: Callable[..., tuple[ndarray, ndarray]], surface: TSpline, mesh: TriangleMesh, tolerance: float
) -> None:
    points = surface.positions(*inner_samples(surface, 3, 5000))
    assert np.sqrt(igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)[0].max()) <= tolerance


@pytest.mark.parametrize("name", MODELS)
def test_models_are_tessellated_without_a_gap(
    inner_samples: Callable[..., tuple[ndarray, ndarray]], shared: Path, name: str
) -> None:
    surface = read_tsm(shared / "tspline" / "tsm" / f"{name}.tsm")
    tolerance = 1e-3 * np.ptp(surface.control_points, axis=0).max()
    found = surface.tessellate_with_parameters(tolerance)
    assert found.deviation <= tolerance
    assert_within(inner_samples, surface, found.mesh, tolerance)
    middles = found.parameters[border(found.mesh)].mean(axis=1)
    tmesh = surface.tmesh
    step = 1e-6 * np.ptp(surface.domain)
    boxes = tmesh.face_boxes
    inside = np.zeros(len(middles), dtype=np.int64)
    for ds, dt in ((-step, -step), (step, -step), (-step, step), (step, step)):
        s, t = (middles + np.array([ds, dt])).T
        hit = (
            (boxes[:, 0] < s[:, None])
            & (s[:, None] < boxes[:, 1])
            & (boxes[:, 2] < t[:, None])
            & (t[:, None] < boxes[:, 3])
        )
        inside += hit.any(axis=1)
    assert (inside < 4).all()  # every border edge lies on the border of the domain


@settings(max_examples=6)
@given(st.integers(0, 1000), st.booleans())
def test_random_tsplines_are_tessellated_within_the_tolerance(
    random_tspline: Callable[..., TSpline],
    inner_samples: Callable[..., tuple[ndarray, ndarray]],
    seed: int,
    closed: bool,
) -> None:
    surface = random_tspline(seed, closed)
    found = surface.tessellate_with_parameters(0.02)
    border(found.mesh)
    assert found.deviation <= 0.02
    assert_within(inner_samples, surface, found.mesh, 0.02)


def test_a_bone_on_a_general_tmesh_is_one_closed_outward_sphere(
    bone_like: Callable[..., TSpline], assert_closed_sphere: Callable[[TriangleMesh], None]
) -> None:
    rows = bone_like(12, 9, 1)
    surface = as_general(rows)
    assert surface.poles == (True, True)
    mesh = surface.tessellate(0.05)
    assert_closed_sphere(mesh)
    assert abs(mesh.volume - surface.volume) <= 0.05 * surface.area
    assert surface.volume == pytest.approx(rows.volume, rel=1e-12)
    s = np.linspace(0, 1, 7)
    for t in (0.0, 1.0):
        np.testing.assert_allclose(surface.normals(s, np.full(7, t)), rows.normals(s, np.full(7, t)), atol=1e-9)


def test_a_torus_turned_inside_out_is_outward(torus_text: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "torus.tsm").write_text(torus_text())
    surface = read_tsm(tmp_path / "torus.tsm", to_mm=True)
    inside_out = surface.with_control_points(surface.control_points * [1, 1, -1])
    assert inside_out.volume < 0
    for one in (surface, inside_out):
        mesh = one.tessellate(0.5)
        assert len(border(mesh)) == 0
        assert mesh.volume == pytest.approx(abs(one.volume), rel=0.05)


@pytest.mark.parametrize("name", MODELS)
def test_no_point_of_a_model_is_nearer_than_the_foot(
    inner_samples: Callable[..., tuple[ndarray, ndarray]], shared: Path, name: str
) -> None:
    surface = read_tsm(shared / "tspline" / "tsm" / f"{name}.tsm")
    size = np.ptp(surface.control_points, axis=0).max()
    feet = surface.positions(*inner_samples(surface, 5, 1000))
    points = feet + 0.02 * size * np.random.default_rng(5).standard_normal((1000, 3))
    mesh = surface.tessellate(2e-4 * size)
    nearest = np.sqrt(igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)[0])
    found = surface.project(points)
    assert (found.distances - nearest <= 2e-4 * size).mean() >= 0.999
    assert surface.project(feet).distances.max() <= 1e-9 * size
    np.testing.assert_allclose(surface.positions(found.s, found.t), found.points, atol=1e-12 * size)
