"""The surface through an open mesh with four corners: near the mesh, faced as it is, its parameters along the sides."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from bonecam.errors import SurfaceError
from bonecam.mesh.distance import hausdorff
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface import patch_surface, skinning


def patch(across: int = 24, along: int = 36, *, flipped: bool = False) -> TriangleMesh:
    """A bent, twisted patch of 50 x 30 mm, its inner vertices moved at random."""
    u, v = (side.ravel() for side in np.meshgrid(np.linspace(0, 1, along), np.linspace(0, 1, across)))
    inner = (u > 0) & (u < 1) & (v > 0) & (v < 1)
    moved = np.random.default_rng(4).uniform(-0.3, 0.3, (2, len(u))) * inner
    u, v = u + moved[0] / along, v + moved[1] / across
    bent = np.column_stack([50 * u, 30 * v, 6 * np.sin(3 * u) * np.cos(2 * v) + 4 * u * v])
    faces = Delaunay(np.column_stack([u, v])).simplices
    return TriangleMesh(bent, faces[:, ::-1] if flipped else faces)


@pytest.mark.parametrize("flipped", [False, True])
def test_it_lies_within_the_tolerance_and_faces_as_the_triangles_do(flipped: bool) -> None:
    mesh = patch(flipped=flipped)
    surface = patch_surface(mesh, 0.05)
    skinned = surface.tessellate(0.005)
    assert max(hausdorff(skinned, mesh)) <= 0.06
    facing = mesh.face_vectors.sum(axis=0)[2]
    (low, high), (first, last) = surface.domain
    inside = np.random.default_rng(0).uniform(size=(40, 2))
    normals = surface.normals(low + (high - low) * inside[:, 0], first + (last - first) * inside[:, 1])
    assert (np.sign(facing) * normals[:, 2] > 0.3).all()
    assert surface.area == pytest.approx(mesh.area, rel=2e-3)


def test_the_corners_of_its_domain_are_the_corners_of_the_mesh() -> None:
    mesh = patch()
    surface = patch_surface(mesh, 0.05)
    s, t = (np.array(side) for side in surface.domain)
    corners = surface.positions(np.repeat(s, 2), np.tile(t, 2))
    wanted = np.array(
        [
            mesh.vertices[np.argmin(np.hypot(*(mesh.vertices[:, :2] - xy).T))]
            for xy in ((0, 0), (0, 30), (50, 0), (50, 30))
        ]
    )
    away = np.linalg.norm(corners[:, None] - wanted, axis=2).min(axis=1)
    assert away.max() < 0.02


def test_a_mesh_that_is_no_patch_is_refused() -> None:
    mesh = patch()
    middle = np.hypot(*(mesh.vertices[mesh.faces].mean(axis=1)[:, :2] - [25, 15]).T) < 4
    with pytest.raises(SurfaceError, match="has 2 edges: cut it open"):
        patch_surface(TriangleMesh(mesh.vertices, mesh.faces[~middle]), 0.05)
    corners = np.array([[0, 0, 0], [20, 0, 0], [0, 20, 0], [0, 0, 20.0]])
    with pytest.raises(SurfaceError, match="is closed"):
        patch_surface(
            TriangleMesh(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)), 0.05
        )


def test_a_mesh_too_rough_for_the_tolerance_is_refused_with_what_is_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(skinning, "MOST", 2 * skinning.FEWEST)
    mesh = patch()
    rough = mesh.vertices + np.random.default_rng(1).normal(0, 0.4, mesh.vertices.shape)
    with pytest.raises(SurfaceError, match=r"misses it by .* mm: smooth the mesh, or raise surface.tolerance"):
        patch_surface(TriangleMesh(rough, mesh.faces), 0.01)
