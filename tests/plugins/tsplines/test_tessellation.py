"""Tessellation and projection of general T-splines: conforming, within tolerance, nearest feet beside notches
and borders.

Surfaces of .iga files as meshes: joined where the elements meet, extraordinary points and poles included.
"""

import igl
import numpy as np
import pytest
from bonecam_plugins.tsplines import ExtractedTMesh, read_iga, read_tsm, write_iga
from general_tsplines import inner_samples, random_tspline, torus_text
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_bodies import assert_closed_sphere
from rows_to_general import as_general
from tsplines import bone_like

from bonecam.errors import SurfaceError
from bonecam.mesh import TriangleMesh
from bonecam.surface import TSpline, tessellate

MODELS = ("simple", "fan", "Bike", "mouse", "face", "gearbox2-9")


def border(mesh: TriangleMesh) -> np.ndarray:
    """Vertex pairs of the edges with one face; no edge may have more than two."""
    edges = np.sort(np.vstack([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() <= 2
    return unique[count == 1]


def assert_within(surface: TSpline, mesh: TriangleMesh, tolerance: float) -> None:
    points = surface.positions(*inner_samples(surface, 3, 5000))
    assert np.sqrt(igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)[0].max()) <= tolerance


@pytest.mark.parametrize("name", MODELS)
def test_models_are_tessellated_without_a_gap(shared, name):
    surface = read_tsm(shared / "tspline" / "tsm" / f"{name}.tsm")
    tolerance = 1e-3 * np.ptp(surface.control_points, axis=0).max()
    found = surface.tessellate_with_parameters(tolerance)
    assert found.deviation <= tolerance
    assert_within(surface, found.mesh, tolerance)
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
def test_random_tsplines_are_tessellated_within_the_tolerance(seed, closed):
    surface = random_tspline(seed, closed)
    found = surface.tessellate_with_parameters(0.02)
    border(found.mesh)
    assert found.deviation <= 0.02
    assert_within(surface, found.mesh, 0.02)


def test_a_bone_on_a_general_tmesh_is_one_closed_outward_sphere():
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


def test_a_torus_turned_inside_out_is_outward(tmp_path):
    (tmp_path / "torus.tsm").write_text(torus_text())
    surface = read_tsm(tmp_path / "torus.tsm", to_mm=True)
    inside_out = surface.with_control_points(surface.control_points * [1, 1, -1])
    assert inside_out.volume < 0
    for one in (surface, inside_out):
        mesh = one.tessellate(0.5)
        assert len(border(mesh)) == 0
        assert mesh.volume == pytest.approx(abs(one.volume), rel=0.05)


@pytest.mark.parametrize("name", MODELS)
def test_no_point_of_a_model_is_nearer_than_the_foot(shared, name):
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


AREAS = {"arch_nurbs": 3 * np.pi / 4, "arch_tsplines": 3 * np.pi / 4, "plate_with_hole": 16 - np.pi / 4}


AREAS |= {"square_structured": 1.0, "square_unstructured": 1.0}


def borders(mesh: TriangleMesh) -> int:
    """Loops of edges with one face; every other edge has two that run it both ways."""
    ways = {(int(a), int(b)) for face in mesh.faces for a, b in zip(face, np.roll(face, -1))}
    assert len(ways) == 3 * len(mesh.faces)
    following = {b: a for a, b in ways if (b, a) not in ways}
    assert len(following) == sum((b, a) not in ways for a, b in ways)
    loops = 0
    while following:
        loops, here = loops + 1, next(iter(following))
        while here in following:
            here = following.pop(here)
    return loops


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
@pytest.mark.parametrize("model", AREAS)
def test_the_models_become_one_conforming_mesh_within_the_tolerance(shared, model, tolerance):
    surface = read_iga(shared / "tspline" / "iga" / f"{model}.iga")
    found = surface.tessellate_with_parameters(tolerance)
    assert borders(found.mesh) == 1
    assert found.deviation <= tolerance
    assert found.mesh.area == pytest.approx(AREAS[model], abs=8 * tolerance)
    np.testing.assert_allclose(surface.evaluate(*found.parameters.T), found.mesh.vertices, atol=1e-9)


def test_a_bone_with_poles_comes_back_closed_and_outward(tmp_path):
    bone = bone_like(8, 6, 2)
    write_iga(bone, tmp_path / "bone.iga")
    mesh = read_iga(tmp_path / "bone.iga").tessellate(0.02)
    assert borders(mesh) == 0
    assert mesh.volume == pytest.approx(bone.volume, rel=5e-3)
    assert len(np.unique(mesh.faces)) - len(mesh.faces) // 2 == 2
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    assert bone.project(centres).distances.max() < 0.02


def test_t_junctions_are_joined(tmp_path):
    surface = random_tspline(4)
    write_iga(surface, tmp_path / "a.iga")
    mesh = read_iga(tmp_path / "a.iga").tessellate(0.01)
    assert borders(mesh) == 1
    assert mesh.area == pytest.approx(surface.area, rel=0.02)


def test_what_cannot_be_had_is_an_error(tmp_path):
    write_iga(random_tspline(4), tmp_path / "a.iga")
    surface: TSpline[ExtractedTMesh] = read_iga(tmp_path / "a.iga")
    with pytest.raises(SurfaceError, match=r"element \d+ cannot be tessellated .* raise the tolerance"):
        surface.tessellate(1e-12)
    assert len(tessellate(surface, 1e-3, most_vertices=100_000).mesh.vertices) < 100_000
    with pytest.raises(SurfaceError, match=r"element \d+ cannot be tessellated .* raise the tolerance"):
        tessellate(surface, 1e-3, most_vertices=500)
    with pytest.raises(ValueError, match="positive"):
        surface.tessellate(0.1, 0.0)


def test_the_normals_along_an_edge_keep_the_angle(tmp_path):
    write_iga(random_tspline(4), tmp_path / "a.iga")
    surface = read_iga(tmp_path / "a.iga")
    coarse, fine = surface.tessellate(0.1), surface.tessellate_with_parameters(0.1, 0.15)
    assert borders(fine.mesh) == 1
    assert len(fine.mesh.faces) > len(coarse.faces)
    a, b = fine.mesh.faces.ravel(), np.roll(fine.mesh.faces, -1, axis=1).ravel()
    long = np.linalg.norm(fine.mesh.vertices[a] - fine.mesh.vertices[b], axis=1) > 0.1
    normals = surface.normals(*fine.parameters.T)
    turns = np.arccos(np.clip(np.einsum("ij,ij->i", normals[a[long]], normals[b[long]]), -1, 1))
    assert turns.max() < 0.15 + 1e-9
