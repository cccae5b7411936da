"""Remeshing: edges that are split leave the surface where it is."""

import numpy as np
import pytest

from bonecam.mesh.remesh import split_edges
from bonecam.mesh.triangle_mesh import TriangleMesh


def test_edges_are_split_and_the_surface_stays() -> None:
    cube = TriangleMesh(*_cube())
    fine = split_edges(cube, 0.3)
    sides = fine.vertices[fine.faces] - np.roll(fine.vertices[fine.faces], 1, axis=1)
    assert np.linalg.norm(sides, axis=2).max() <= 0.3
    assert fine.volume == pytest.approx(cube.volume)
    assert split_edges(cube, 2.0) is cube
    with pytest.raises(ValueError, match="give a positive length"):
        split_edges(cube, 0.0)


def _cube() -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))], dtype=np.int32)
