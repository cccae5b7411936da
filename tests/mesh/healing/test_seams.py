"""Corners of neighbouring faces become one vertex where they lie, within a stated distance."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.errors import MeshError
from bonecam.mesh.healing import RepairState, faults_of, repair, weld_seams
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces, side_by_side


def soup_of(mesh: TriangleMesh, spread: float, seed: int = 0) -> TriangleMesh:
    """Every face with corners of its own, each moved by up to `spread` mm along each axis."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    moved = corners + np.random.default_rng(seed).uniform(-spread, spread, corners.shape)
    return TriangleMesh(moved, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))


@pytest.mark.parametrize("shift", [0.0, 1000.0])
@pytest.mark.parametrize("spread", [0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 3e-4])
def test_a_soup_of_triangles_becomes_the_bone(bone: TriangleMesh, spread: float, shift: float) -> None:
    given = soup_of(TriangleMesh(bone.vertices + shift, bone.faces), spread)
    mesh, done = repair(given)
    assert faults_of(mesh) == ()
    assert len(mesh.vertices) == len(bone.vertices)
    assert len(mesh.faces) == len(bone.faces)
    assert mesh.volume == pytest.approx(bone.volume, abs=bone.area * 2 * spread + 1e-6 * bone.volume)
    assert str(done[0]).startswith(f"merged {3 * len(bone.faces) - len(bone.vertices)} duplicate vertices")
    if spread:
        told = float(done[0].change.split(" at most ")[1].removesuffix(" mm apart"))
        assert spread < told <= 2 * np.sqrt(3) * spread * 1.01
        assert max(done[0].outward, done[0].inward) <= told


@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-4, 1e-3])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_halves_that_share_no_seam_are_joined(bone: TriangleMesh, gap: float, axis: int) -> None:
    above = bone.vertices[bone.faces].mean(axis=1)[:, axis] > 0.3
    upper, lower = keep_faces(bone, above), keep_faces(bone, ~above)
    moved = TriangleMesh(upper.vertices + gap * np.eye(3)[axis], upper.faces)
    mesh, done = repair(side_by_side([lower, moved]))
    assert faults_of(mesh) == ()
    assert len(mesh.vertices) == len(bone.vertices)
    assert str(done[0]).startswith("merged ")
    kept = mesh.vertices[:, None] == np.concatenate([lower.vertices, moved.vertices])
    assert kept.all(axis=2).any(axis=1).all()


def test_what_is_closed_is_never_merged(bone: TriangleMesh) -> None:
    near = TriangleMesh(0.05 * bone.vertices + [5.25 + 1e-9, 0, 0], bone.faces)
    both = side_by_side([bone, near])
    assert weld_seams(RepairState(both)).mesh is both


def test_gaps_wider_than_the_tolerance_stay_open(bone: TriangleMesh) -> None:
    with pytest.raises(MeshError, match=r"separate parts.*merge close vertices in a mesh editor"):
        repair(soup_of(bone, 0.05))


def test_no_edge_collapses(bone: TriangleMesh) -> None:
    scaled = TriangleMesh(bone.vertices * [1, 1, 1e-3], bone.faces)
    mesh = weld_seams(RepairState(soup_of(scaled, 1e-7))).mesh
    assert len(mesh.faces) == len(bone.faces)
    assert len(mesh.vertices) == len(bone.vertices)


def test_a_saved_twice_mesh_is_taken_once(bone: TriangleMesh, is_same: Callable[..., bool]) -> None:
    mesh, done = repair(side_by_side([bone, bone]))
    assert is_same(mesh, bone)
    assert str(done[0]) == f"removed {len(bone.faces)} duplicate faces"
