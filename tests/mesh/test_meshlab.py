"""Remeshing: edges that are split leave the surface where it is."""

import numpy as np
import pytest
from mesh_bodies import is_closed

from bonecam.mesh import TriangleMesh, remesh, self_intersections
from bonecam.mesh.meshlab import angle_sums, bisect_faces, split_edges
from bonecam.setup import Box


def test_edges_are_split_and_the_surface_stays():
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


@pytest.mark.parametrize("turn", np.arange(6) / 10)
def test_a_remesh_keeps_the_tip_of_a_cone_however_it_is_turned(turn):
    angle = turn + 2 * np.pi * np.arange(40) / 40
    ring = np.column_stack([3 * np.cos(angle), 3 * np.sin(angle), 0 * angle])
    i = np.arange(40)
    right = (i + 1) % 40
    faces = np.concatenate([np.stack([i, right, 0 * i + 41], 1), np.stack([right, i, 0 * i + 40], 1)])
    cone = TriangleMesh(np.vstack([ring, [0, 0, 0], [0, 0, 12.0]]), faces.astype(np.int32))
    even = remesh(cone, 0.2)
    assert np.array_equal(even.vertices[np.argmax(even.vertices[:, 2])], [0, 0, 12.0])
    assert even.volume == pytest.approx(cone.volume, rel=3e-3)


def test_the_angles_at_a_corner_of_a_cube_sum_to_three_right_ones():
    assert angle_sums(TriangleMesh(*_cube())) == pytest.approx(np.full(8, 1.5 * np.pi))


def test_the_longest_edges_of_chosen_faces_are_halved_and_the_mesh_stays_closed():
    mesh, rng = Box(np.zeros(3), np.array([1.0, 2.0, 3.0])).mesh(0.05), np.random.default_rng(1)
    for _ in range(4):
        chosen = rng.random(len(mesh.faces)) < 0.2
        before, mesh = mesh, bisect_faces(mesh, chosen)
        assert is_closed(mesh)
        assert np.array_equal(mesh.vertices[: len(before.vertices)], before.vertices)
        assert not set(map(tuple, before.faces[chosen])) & set(map(tuple, mesh.faces))
        assert (mesh.volume, mesh.area) == pytest.approx((6.0, 22.0))
    assert not len(self_intersections(mesh))
    corners = mesh.vertices[mesh.faces]
    sides, nexts = corners - np.roll(corners, 1, axis=1), np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2) * np.linalg.norm(nexts, axis=2)
    assert np.degrees(np.arccos(-(sides * nexts).sum(2) / lengths)).min() > 15


def test_nothing_chosen_changes_nothing():
    mesh = Box(np.zeros(3), np.ones(3)).mesh(0.05)
    same = bisect_faces(mesh, np.zeros(len(mesh.faces), dtype=bool))
    assert np.array_equal(same.faces, mesh.faces)
    assert np.array_equal(same.vertices, mesh.vertices)
