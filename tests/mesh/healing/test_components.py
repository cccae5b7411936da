"""Debris and inner shells are left out where they are: the rest keeps its vertices to the bit."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.errors import MeshError
from bonecam.job import MeshJob
from bonecam.mesh.healing import components_of, faults_of, repair
from bonecam.mesh.part import prepare_part
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces, side_by_side

SIZES = (0.02, 0.1, 0.3, 1.0, 3.0)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("face", [3, 400, 777, 1534])
@pytest.mark.parametrize("kind", ["vertex", "edge", "face", "wall"])
def test_debris_that_touches_is_dropped_and_the_bone_stays_to_the_bit(
    bone: TriangleMesh,
    with_debris: Callable[..., TriangleMesh],
    is_same: Callable[..., bool],
    kind: str,
    face: int,
    size: float,
) -> None:
    mesh, done = repair(with_debris(bone, kind, face, size))
    assert is_same(mesh, bone)
    assert any(each.change.startswith("dropped 1") and each.left_out is not None for each in done)
    assert sum(each.guessed for each in done) > 0.0
    assert all(each.outward == each.inward == 0 for each in done)


@pytest.mark.parametrize("kind", ["vertex", "edge", "face", "wall"])
def test_debris_is_dropped_whatever_the_order_and_side_of_the_faces(
    bone: TriangleMesh, with_debris: Callable[..., TriangleMesh], is_same: Callable[..., bool], kind: str
) -> None:
    given = with_debris(bone, kind, 500, 0.4)
    order = np.random.default_rng(1).permutation(len(given.faces))
    shuffled = TriangleMesh(given.vertices, given.faces[order])
    assert is_same(repair(shuffled)[0], bone)
    turned = TriangleMesh(given.vertices, given.faces[order][:, ::-1])
    mesh, done = repair(turned)
    assert is_same(mesh, bone)
    assert "mirror" in "; ".join(map(str, done))


def test_much_debris_is_dropped_at_once(
    bone: TriangleMesh, with_debris: Callable[..., TriangleMesh], is_same: Callable[..., bool]
) -> None:
    given = bone
    for number, face in enumerate(range(40, 1500, 70)):
        given = with_debris(given, ("vertex", "edge", "face", "wall")[number % 4], face, 0.2)
    mesh, done = repair(given)
    assert is_same(mesh, bone)
    assert not any("skin" in each.change for each in done)


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("height", [-4.0, 0.0, 1.0])
@pytest.mark.parametrize("inward", [True, False])
def test_an_inner_shell_is_filled_and_told_with_its_volume(
    bone: TriangleMesh, is_same: Callable[..., bool], share: float, height: float, inward: bool
) -> None:
    shell = TriangleMesh(share * bone.vertices + [0, 0, height * (1 - share)], bone.faces[:, :: -1 if inward else 1])
    mesh, done = repair(side_by_side([shell, bone]))
    assert is_same(mesh, bone)
    assert [each.change for each in done] == [
        f"filled an inner shell (cavity) of {abs(shell.volume):.3g} mm3 near (0.00, 0.00, {height * (1 - share):z.2f})"
    ]
    assert done[0].guessed == 0.0


def test_a_cavity_that_comes_out_of_the_part_is_told_to(bone: TriangleMesh, is_same: Callable[..., bool]) -> None:
    through = TriangleMesh(0.5 * bone.vertices + [2.7, 0, 0], bone.faces[:, ::-1])
    mesh, done = repair(side_by_side([bone, through]))
    assert is_same(mesh, bone)
    assert str(done[0]).endswith("it comes out through the surface")


def test_many_cavities_are_told_in_one_sentence(bone: TriangleMesh, is_same: Callable[..., bool]) -> None:
    places = [(x, y, z) for x in (-1.5, 1.5) for y in (-1, 1) for z in (-6, 0, 6)]
    pores = [TriangleMesh(0.05 * bone.vertices + place, bone.faces[:, ::-1]) for place in places]
    mesh, done = repair(side_by_side([*pores, bone]))
    assert is_same(mesh, bone)
    assert str(done[0]).startswith("filled 12 inner shells (cavities), 1.")


def test_a_closed_piece_beside_the_part_is_another_part(bone: TriangleMesh) -> None:
    for shift in ([12, 0, 0], [4, 0, 0]):
        with pytest.raises(MeshError, match=r"2 separate parts, the second largest near .*: save the one"):
            repair(side_by_side([bone, TriangleMesh(0.8 * bone.vertices + shift, bone.faces)]))


def test_a_folded_shell_inside_is_not_taken_for_the_part(bone: TriangleMesh, is_same: Callable[..., bool]) -> None:
    length = np.linalg.norm(bone.vertices, axis=1, keepdims=True)
    folds = 1 - 0.35 * (1 + np.cos(np.arange(len(bone.vertices)) * np.pi))[:, None] * (length > 0)
    rough = TriangleMesh(0.97 * bone.vertices * folds, bone.faces[:, ::-1])
    assert rough.area > bone.area
    mesh, done = repair(side_by_side([rough, bone]))
    assert is_same(mesh, bone)
    assert "inner shell" in str(done[0])


def test_components_meet_at_vertices_and_edges_but_not_across_a_wall(
    bone: TriangleMesh, with_debris: Callable[..., TriangleMesh]
) -> None:
    for kind, count in (("vertex", 2), ("edge", 2), ("wall", 1)):
        assert components_of(with_debris(bone, kind, 9, 0.3)).max() + 1 == count


def test_the_mesh_as_given_is_compared_without_what_was_left_out(
    bone: TriangleMesh, with_debris: Callable[..., TriangleMesh]
) -> None:
    given = with_debris(bone, "vertex", 700, 0.5)
    part = prepare_part(given, MeshJob(pit_radius=0.0))
    assert len(part.given.faces) == len(bone.faces) + 4
    assert len(part.placed_given.faces) == len(bone.faces)
    assert part.repair_deviation < 1e-12
    assert [len(each.faces) for each in part.left_out] == [4]
    assert part.taken_off is not None
    assert part.taken_off.depth < 1e-5, "open3d's float32"
    assert part.move(np.eye(4)).taken_off is part.taken_off


def test_an_open_sheet_inside_is_dropped_and_told_as_that(bone: TriangleMesh, is_same: Callable[..., bool]) -> None:
    sheet = keep_faces(TriangleMesh(0.5 * bone.vertices, bone.faces), bone.vertices[bone.faces].mean(1)[:, 2] > 2)
    mesh, done = repair(side_by_side([sheet, bone]))
    assert is_same(mesh, bone)
    assert str(done[0]).startswith("dropped 1 open sheet inside the part, near (")


def test_a_cavity_is_found_in_a_bone_with_a_hole(bone: TriangleMesh) -> None:
    cavity = TriangleMesh(0.4 * bone.vertices, bone.faces[:, ::-1])
    mesh, done = repair(side_by_side([cavity, keep_faces(bone, np.arange(len(bone.faces)) >= 4)]))
    assert faults_of(mesh) == ()
    assert mesh.volume == pytest.approx(bone.volume, rel=0.01)
    assert [each.change.split()[0] for each in done] == ["filled", "closed"]
