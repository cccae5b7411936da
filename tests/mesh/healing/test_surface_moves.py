"""How far a repair moved the surface is told for each side."""

import numpy as np
import pytest

from bonecam.mesh.healing import Repair, repair, surface_moves, winding_numbers
from bonecam.mesh.triangle_mesh import TriangleMesh, side_by_side


def dented(mesh: TriangleMesh, vertex: int, by: float) -> TriangleMesh:
    """The mesh with one vertex pushed along its direction from the origin."""
    vertices = np.array(mesh.vertices)
    vertices[vertex] *= 1 + by / np.linalg.norm(vertices[vertex])
    return TriangleMesh(vertices, mesh.faces)


@pytest.mark.parametrize("turned", [False, True])
def test_both_sides_are_found_where_one_moved_farther(bone: TriangleMesh, turned: bool) -> None:
    before = dented(dented(bone, 100, 0.3), 500, -0.2)
    after = TriangleMesh(bone.vertices, bone.faces[:, :: -1 if turned else 1])
    moves = surface_moves(before, after)
    assert 0.2 < moves.inward <= 0.3
    assert 0.1 < moves.outward <= 0.2
    assert moves.largest == moves.inward
    assert np.allclose(moves.place, before.vertices[100])


def test_the_smaller_side_is_found_among_many_points_of_the_larger(bone: TriangleMesh) -> None:
    before = dented(TriangleMesh(bone.vertices * 1.05, bone.faces), 300, -0.5)
    moves = surface_moves(before, bone)
    assert moves.inward == pytest.approx(0.7, abs=0.01)
    assert 0.05 < moves.outward < 0.5
    assert surface_moves(bone, bone).largest == 0


def test_what_lies_inside_the_solid_does_not_count(bone: TriangleMesh) -> None:
    inner = TriangleMesh(0.5 * bone.vertices, bone.faces)
    both = side_by_side([bone, inner])
    assert surface_moves(both, bone).outward > 2
    assert surface_moves(both, bone, bone).largest == 0


def test_winding_numbers_tell_the_side_of_open_and_turned_meshes_too(bone: TriangleMesh) -> None:
    places = np.array([[0, 0, 0], [0, 0, 13.0], [9, 0, 0], [4.8, 0, 0.0]])
    inside = np.array([1, 1, 0, 1])
    assert np.allclose(winding_numbers(bone, places), inside, atol=0.01)
    assert np.allclose(winding_numbers(TriangleMesh(bone.vertices, bone.faces[:, ::-1]), places), -inside, atol=0.01)
    assert np.allclose(winding_numbers(TriangleMesh(bone.vertices, bone.faces[3:]), places), inside, atol=0.1)


def test_a_sentence_tells_the_movement_and_the_report_has_it(bone: TriangleMesh) -> None:
    made = Repair.between("changed it", dented(bone, 100, 0.3), bone)
    assert str(made).startswith("changed it; moved the surface 0.000 mm outward, 0.2")
    moved = {"outward_mm": 0.0, "inward_mm": round(made.inward, 6)}
    assert made.report == {"change": "changed it", **moved, "guessed_mm2": 0.0}
    assert str(Repair("changed it", 4e-4, 4e-4)) == "changed it"


def test_a_new_skin_tells_how_far_it_lies_from_the_mesh(bone: TriangleMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*_: object, **__: object) -> None:
        raise RuntimeError("Mesh boolean failed")

    monkeypatch.setattr("igl.copyleft.cgal.mesh_boolean", refuses)
    vertices = np.array(bone.vertices)
    vertices[np.argmax(vertices[:, 0])] += [-0.5, 2, 3]
    skin = repair(TriangleMesh(vertices, bone.faces))[1][-1]
    assert "new skin" in skin.change
    assert skin.outward > 0.02
    assert "mm outward" in str(skin)
