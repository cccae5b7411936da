"""Surfaces of .iga files as meshes: joined where the elements meet, extraordinary points and poles
included."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import SurfaceError
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface import ExtractedTMesh, TSpline, read_iga, write_iga
from bonecam.surface.files.tspline_text import save_surface
from bonecam.surface.tessellation import tessellate

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
def test_the_models_become_one_conforming_mesh_within_the_tolerance(shared: Path, model: str, tolerance: float) -> None:
    surface = read_iga(shared / "tspline" / "iga" / f"{model}.iga")
    found = surface.tessellate_with_parameters(tolerance)
    assert borders(found.mesh) == 1
    assert found.deviation <= tolerance
    assert found.mesh.area == pytest.approx(AREAS[model], abs=8 * tolerance)
    np.testing.assert_allclose(surface.evaluate(*found.parameters.T), found.mesh.vertices, atol=1e-9)


def test_a_bone_with_poles_comes_back_closed_and_outward(bone_like: Callable[..., TSpline], tmp_path: Path) -> None:
    bone = bone_like(8, 6, 2)
    write_iga(bone, tmp_path / "bone.iga")
    mesh = read_iga(tmp_path / "bone.iga").tessellate(0.02)
    assert borders(mesh) == 0
    assert mesh.volume == pytest.approx(bone.volume, rel=5e-3)
    assert len(np.unique(mesh.faces)) - len(mesh.faces) // 2 == 2
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    assert bone.project(centres).distances.max() < 0.02


def test_t_junctions_are_joined(random_tspline: Callable[..., TSpline], tmp_path: Path) -> None:
    surface = random_tspline(4)
    write_iga(surface, tmp_path / "a.iga")
    mesh = read_iga(tmp_path / "a.iga").tessellate(0.01)
    assert borders(mesh) == 1
    assert mesh.area == pytest.approx(surface.area, rel=0.02)


def test_what_cannot_be_had_is_an_error(random_tspline: Callable[..., TSpline], tmp_path: Path) -> None:
    write_iga(random_tspline(4), tmp_path / "a.iga")
    surface: TSpline[ExtractedTMesh] = read_iga(tmp_path / "a.iga")
    with pytest.raises(SurfaceError, match=r"element \d+ cannot be tessellated .* raise the tolerance"):
        surface.tessellate(1e-12)
    assert len(tessellate(surface, 1e-3, most_vertices=100_000).mesh.vertices) < 100_000
    with pytest.raises(SurfaceError, match=r"element \d+ cannot be tessellated .* raise the tolerance"):
        tessellate(surface, 1e-3, most_vertices=500)
    with pytest.raises(ValueError, match="positive"):
        surface.tessellate(0.1, 0.0)


def test_the_normals_along_an_edge_keep_the_angle(random_tspline: Callable[..., TSpline], tmp_path: Path) -> None:
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


def test_any_surface_is_saved_as_iga(bone_like: Callable[..., TSpline], tmp_path: Path) -> None:
    bone = bone_like(6, 5, 2)
    save_surface(bone, tmp_path / "bone.iga")
    again = read_iga(tmp_path / "bone.iga")
    assert again.control_points.tobytes() == bone.control_points.tobytes()
    assert again.area == pytest.approx(bone.area, rel=1e-12)
