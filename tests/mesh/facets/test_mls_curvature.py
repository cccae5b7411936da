"""Curvature by moving least squares against a torus, whose curvatures are known, and on plain shapes."""

import numpy as np
import pytest
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh.facets import SurfaceShape, delaunay, mls_curvature, vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh

RING, TUBE = 20.0, 6.0


def torus(around: int, across: int) -> tuple[TriangleMesh, ndarray, ndarray]:
    """The mesh, and at its vertices the angle round the tube and the exact normals."""
    u, v = (
        grid.ravel()
        for grid in np.meshgrid(
            np.arange(around) * 2 * np.pi / around, np.arange(across) * 2 * np.pi / across, indexing="ij"
        )
    )
    radial = np.column_stack([np.cos(u), np.sin(u), 0 * u])
    normals = np.cos(v)[:, None] * radial + np.sin(v)[:, None] * [0, 0, 1]
    index = np.arange(around * across).reshape(around, across)
    a, b = index, np.roll(index, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    quads = np.stack([a, b, c, d], axis=-1).reshape(-1, 4)
    faces = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    return TriangleMesh(RING * radial + TUBE * normals, faces), v, normals


def errors(around: int, across: int) -> tuple[float, float]:
    """Median errors of k1 and k2 as shares."""
    mesh, v, _ = torus(around, across)
    found = mls_curvature(mesh)
    along = np.cos(v) / (RING + TUBE * np.cos(v))
    clear = np.abs(np.cos(v)) > 0.2
    return (float(np.median(np.abs(found.k1 * TUBE - 1))), float(np.median(np.abs(found.k2 / along - 1)[clear])))


def test_errors_on_a_torus_fall_with_the_square_of_the_edge() -> None:
    coarse, fine = errors(60, 30), errors(120, 60)
    assert max(fine) < 0.012
    for large, small in zip(coarse, fine):
        assert 3.2 < large / small < 4.8


def test_shapes_on_a_torus_are_convex_outside_and_saddles_inside() -> None:
    mesh, v, normals = torus(120, 60)
    found = mls_curvature(mesh)
    assert set(found.shapes[np.cos(v) > 0.4]) == {SurfaceShape.CONVEX}
    assert set(found.shapes[np.cos(v) < -0.4]) == {SurfaceShape.SADDLE}
    assert set(found.shapes[np.abs(np.cos(v)) < 1e-9]) == {SurfaceShape.PARABOLIC}
    assert np.abs(np.einsum("ij,ij->i", found.direction1, normals)).max() < 0.02


def test_a_ball_is_convex_and_turned_inside_out_concave() -> None:
    mesh, _, _ = torus(60, 30)
    inside_out = TriangleMesh(mesh.vertices, mesh.faces[:, ::-1].copy())
    outer = mls_curvature(mesh)
    inner = mls_curvature(inside_out)
    np.testing.assert_allclose(inner.k2, -outer.k1, rtol=1e-9)
    assert (inner.k1 >= inner.k2).all()


def test_a_plane_is_planar_everywhere() -> None:
    places = np.random.default_rng(3).random((60, 2)) * 10
    mesh = TriangleMesh(np.column_stack([places, np.zeros(60)]), delaunay(places))
    found = mls_curvature(mesh, radius=4.0)
    assert np.abs(found.k1).max() < 1e-12
    assert set(found.shapes) == {SurfaceShape.PLANAR}


def test_a_patch_on_a_tilted_frame_needs_both_fundamental_forms() -> None:
    """z = x^2/20 - y^2/12 + 0.3 x: its Hessian alone, in its upright frame, errs; ours agrees with the formula."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21)))
    places = np.column_stack([x, y])
    mesh = TriangleMesh(np.column_stack([places, x**2 / 20 - y**2 / 12 + 0.3 * x]), delaunay(places))
    middle = int(np.argmin(x**2 + y**2))
    found = mls_curvature(mesh, radius=0.35)
    slope = 1 + 0.3**2
    exact = (1 / 6 / slope**0.5, -1 / 10 / slope**1.5)
    np.testing.assert_allclose((found.k1[middle], found.k2[middle]), exact, rtol=2e-3)
    assert abs(-2 / 20 - exact[1]) > 0.01  # what the Hessian alone would say


def test_the_other_side_of_a_thin_plate_does_not_count() -> None:
    grid = np.stack(np.meshgrid(np.arange(12.0), np.arange(12.0)), axis=-1).reshape(-1, 2)
    faces = delaunay(grid)
    below = np.column_stack([grid, np.full(len(grid), -0.5)])
    above = np.column_stack([grid, np.zeros(len(grid))])
    plate = TriangleMesh(np.vstack([above, below]), np.vstack([faces, faces[:, ::-1] + len(grid)]).astype(np.int32))
    found = mls_curvature(plate, radius=2.5)
    assert np.abs([found.k1, found.k2]).max() < 1e-12


def test_too_few_neighbours_are_told() -> None:
    mesh, _, _ = torus(12, 6)
    with pytest.raises(MeshError, match=r"vertex 0 has 0 neighbours, too few .* larger radius"):
        mls_curvature(mesh, radius=0.1)
    with pytest.raises(ValueError, match="above 0"):
        mls_curvature(mesh, radius=0.0)


def test_neighbours_on_a_line_or_at_one_place_are_told() -> None:
    """A strip of two rows 1 mm apart; and eight copies of it."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, 12), [0.0, 1.0], indexing="ij"))
    strip = TriangleMesh(np.column_stack([x, y, 0 * x]), delaunay(np.column_stack([x, y])))
    with pytest.raises(MeshError, match="neighbours of vertex 0 lie on a line"):
        mls_curvature(strip, radius=0.9)
    copies = 24 * np.arange(8)[:, None, None]
    faces = (strip.faces + copies).reshape(-1, 3).astype(np.int32)
    again = TriangleMesh(np.tile(strip.vertices, (8, 1)), faces)
    with pytest.raises(MeshError, match="merge equal vertices"):
        mls_curvature(again, radius=0.05)


def test_normals_of_a_torus() -> None:
    mesh, _, normals = torus(120, 60)
    cosines = np.einsum("ij,ij->i", vertex_normals(mesh), normals)
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 0.2


def test_a_vertex_without_faces_has_no_normal() -> None:
    mesh = TriangleMesh(np.eye(4)[:, :3], np.array([[0, 1, 2]], dtype=np.int32))
    with pytest.raises(MeshError, match="vertex 3 has no normal"):
        vertex_normals(mesh)
