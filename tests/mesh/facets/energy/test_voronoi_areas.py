"""Voronoi cells on faces: closed forms, and that they share the area out."""

import numpy as np

from bonecam.mesh.facets import delaunay, voronoi_areas
from bonecam.mesh.triangle_mesh import TriangleMesh


def flat(places: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    return TriangleMesh(np.column_stack([places, np.zeros(len(places))]), faces)


def test_cells_on_a_grid_are_its_squares() -> None:
    places = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0)), axis=-1).reshape(-1, 2) * 0.5
    areas = voronoi_areas(flat(places, delaunay(places))).reshape(5, 5)
    np.testing.assert_allclose(areas[1:-1, 1:-1], 0.25, atol=1e-12)
    np.testing.assert_allclose(areas[0, 1:-1], 0.125, atol=1e-12)
    np.testing.assert_allclose(areas[0, 0], 0.0625, atol=1e-12)


def test_a_point_has_the_places_nearer_to_it_than_to_any_other() -> None:
    """Eq. 10, by counting random places of the hull, away from its obtuse triangles."""
    random = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0)), axis=-1).reshape(-1, 2)
    places = grid + random.uniform(-0.15, 0.15, grid.shape)
    areas = voronoi_areas(flat(places, delaunay(places)))
    inner = np.flatnonzero(((grid > 1) & (grid < 7)).all(axis=1))
    asked = random.uniform(-1, 9, (400_000, 2))
    nearest = np.argmin([((asked - place) ** 2).sum(axis=1) for place in places], axis=0)
    counted = np.bincount(nearest, minlength=len(places)) * 100 / len(asked)
    np.testing.assert_allclose(areas[inner], counted[inner], rtol=0.06)


def test_of_an_obtuse_face_its_widest_corner_has_half() -> None:
    mesh = flat(np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 0.5]]), np.array([[0, 1, 2]], dtype=np.int32))
    np.testing.assert_allclose(voronoi_areas(mesh), [0.25, 0.25, 0.5])


def test_cells_add_up_to_the_area_and_lone_vertices_have_none() -> None:
    places = np.random.default_rng(7).random((200, 2))
    mesh = flat(np.vstack([places, [[5.0, 5.0]]]), delaunay(places))
    areas = voronoi_areas(mesh)
    assert areas[-1] == 0
    assert areas[:-1].min() > 0
    assert abs(areas.sum() - mesh.area) < 1e-12
