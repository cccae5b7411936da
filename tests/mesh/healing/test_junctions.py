"""Edges of more than two faces are resolved by the cells on both sides of the faces."""

from collections.abc import Callable

import igl.copyleft.cgal as cgal
import numpy as np
import pytest

from bonecam.mesh.healing import RepairState, faults_of, repair, resolve_junctions
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces, side_by_side


def with_wall(bone: TriangleMesh, height: float) -> TriangleMesh:
    """The bone parted by a wall across it at a height."""
    around = np.array([[-9, -9, height], [9, -9, height], [9, 9, height], [-9, 9, height]], dtype=np.float64)
    sheet = TriangleMesh(around, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    both = side_by_side([bone, sheet])
    vertices, faces, _, birth, unique = cgal.remesh_self_intersections(
        np.array(both.vertices), both.faces.astype(np.int64)
    )
    mesh = TriangleMesh(vertices, unique[faces].astype(np.int32))
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    inside = ((middles[:, :2] / bone.bounds[1, :2]) ** 2).sum(axis=1) < 1 - (height / bone.bounds[1, 2]) ** 2
    return keep_faces(mesh, (birth < len(bone.faces)) | inside)


@pytest.mark.parametrize("height", [-13.3, -5.0, 0.4, 7.0, 12.5, 13.6])
def test_a_wall_inside_goes_and_both_sides_of_it_stay(bone: TriangleMesh, height: float) -> None:
    given = with_wall(bone, height)
    mesh, done = repair(given)
    assert faults_of(mesh) == ()
    assert mesh.volume == pytest.approx(bone.volume, rel=1e-9)
    assert "inside the part" in str(done[0])
    assert done[0].guessed == 0.0
    assert not any("skin" in each.change for each in done)


def test_all_slabs_between_walls_stay(bone: TriangleMesh) -> None:
    for heights in ((-6.0, 4.0), (-11.0, -6.0, 6.5), (9.0, 11.0, 13.0)):
        given = bone
        for height in heights:
            given = with_wall(given, height)
        mesh, done = repair(given)
        assert faults_of(mesh) == ()
        assert mesh.volume == pytest.approx(bone.volume, rel=1e-9)
        assert "inside the part" in str(done[0])


def test_a_sheet_that_sticks_out_goes(bone: TriangleMesh, is_same: Callable[..., bool]) -> None:
    column = np.arange(32 * 6, 32 * 18, 32)
    outer = len(bone.vertices) + np.arange(len(column))
    vertices = np.concatenate([bone.vertices, bone.vertices[column] + [0.8, 0, 0]])
    strip = [[column[k], column[k + 1], outer[k]] for k in range(len(column) - 1)]
    strip += [[column[k + 1], outer[k + 1], outer[k]] for k in range(len(column) - 1)]
    mesh, done = repair(TriangleMesh(vertices, np.concatenate([bone.faces, strip]).astype(np.int32)))
    assert is_same(mesh, bone)
    assert all(each.outward == each.inward == 0 for each in done)


def test_a_mesh_without_junctions_comes_back_itself(bone: TriangleMesh) -> None:
    assert resolve_junctions(RepairState(bone)).mesh is bone
