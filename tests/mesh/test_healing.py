"""Debris that touches a bone, by recipe.

Debris and inner shells are left out where they are: the rest keeps its vertices to the bit.

Meshes of many faces come down to what the later stages need, measured.

Edges of more than two faces are resolved by the cells on both sides of the faces.

What repairs close, drop or make anew is measured as area, and refused where it is much of the part.

Corners of neighbouring faces become one vertex where they lie, within a stated distance.

How far a repair moved the surface is told for each side.

The union of solids: its volume is that of all points inside one of them; open and inward ones are refused.
"""

import igl.copyleft.cgal as cgal
import numpy as np
import pytest
from bonecam_meshes import path
from mesh_bodies import ellipsoid

from bonecam.errors import LimitError, MeshError
from bonecam.job import Job, MeshJob
from bonecam.machining import stand_part
from bonecam.mesh import MeshDistance, TriangleMesh, prepare_part, read_mesh, repair, repaired_part
from bonecam.mesh.distance import hausdorff
from bonecam.mesh.healing import (
    DECIMATION_DEVIATION,
    Repair,
    RepairState,
    components_of,
    decimate,
    faults_of,
    surface_moves,
    weld_seams,
)
from bonecam.mesh.hollows import cap
from bonecam.mesh.solids import revolve, solid_union
from bonecam.mesh.triangle_mesh import keep_faces, side_by_side
from bonecam.progress import silent
from bonecam.runtime.timing import StageTimes

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
"""Faces of a tetrahedron of positive volume (corner 3 above the triangle 0, 1, 2)."""


def with_debris(bone: TriangleMesh, kind: str, face: int, size: float) -> TriangleMesh:
    """The bone and a tetrahedron `size` mm high that stands on a vertex, an edge or a whole face of it.

    "vertex", "edge" and "face" share the bone's vertices; "wall" has the face between bone and tetrahedron once only.
    """
    corners = bone.faces[face]
    a, b, c = bone.vertices[corners]
    out = np.cross(b - a, c - a)
    out = out / np.linalg.norm(out)
    aside = np.cross(out, b - a) / np.linalg.norm(b - a)
    along = (b - a) / np.linalg.norm(b - a)
    new = len(bone.vertices)
    if kind == "vertex":
        added = a + size * np.array([out + 0.3 * along, out - 0.3 * along, out + 0.3 * aside])
        own = np.array([corners[0], new, new + 1, new + 2])
    elif kind == "edge":
        added = (a + b) / 2 + size * np.array([out + 0.2 * aside, out - 0.2 * aside])
        own = np.array([corners[0], corners[1], new, new + 1])
    else:
        added = (a + b + c)[None] / 3 + size * out
        own = np.array([*corners, new])
    vertices = np.concatenate([bone.vertices, added])
    points = vertices[own]
    faces = own[TETRAHEDRON if np.linalg.det(points[1:] - points[0]) > 0 else TETRAHEDRON[:, ::-1]]
    if kind == "wall":
        faces = faces[[set(trio) != set(corners) for trio in faces.tolist()]]
    return TriangleMesh(vertices, np.concatenate([bone.faces, faces]).astype(np.int32))


def same_rows(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two arrays have the same distinct rows, to the bit."""
    return np.array_equal(np.unique(one, axis=0), np.unique(other, axis=0))


def is_same(one: TriangleMesh, other: TriangleMesh) -> bool:
    """Tells whether two closed meshes have the same vertices and triangles, to the bit, in any order."""
    soups = [np.sort(mesh.vertices[mesh.faces], axis=1).reshape(-1, 9) for mesh in (one, other)]
    same = same_rows(one.vertices, other.vertices) and same_rows(*soups)
    return same and len(one.faces) == len(other.faces) and bool(np.isclose(one.volume, other.volume, 1e-12))


"""Areas that are not as they were given, mm^2; the other repairs leave none."""


SIZES = (0.02, 0.1, 0.3, 1.0, 3.0)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("face", [3, 400, 777, 1534])
@pytest.mark.parametrize("kind", ["vertex", "edge", "face", "wall"])
def test_debris_that_touches_is_dropped_and_the_bone_stays_to_the_bit(bone, kind, face, size):
    mesh, done = repair(with_debris(bone, kind, face, size))
    assert is_same(mesh, bone)
    assert any(each.change.startswith("dropped 1") and each.left_out is not None for each in done)
    assert sum(each.guessed for each in done) > 0.0
    assert all(each.outward == each.inward == 0 for each in done)


@pytest.mark.parametrize("kind", ["vertex", "edge", "face", "wall"])
def test_debris_is_dropped_whatever_the_order_and_side_of_the_faces(bone, kind):
    given = with_debris(bone, kind, 500, 0.4)
    order = np.random.default_rng(1).permutation(len(given.faces))
    shuffled = TriangleMesh(given.vertices, given.faces[order])
    assert is_same(repair(shuffled)[0], bone)
    turned = TriangleMesh(given.vertices, given.faces[order][:, ::-1])
    mesh, done = repair(turned)
    assert is_same(mesh, bone)
    assert "mirror" in "; ".join(map(str, done))


def test_much_debris_is_dropped_at_once(bone):
    given = bone
    for number, face in enumerate(range(40, 1500, 70)):
        given = with_debris(given, ("vertex", "edge", "face", "wall")[number % 4], face, 0.2)
    mesh, done = repair(given)
    assert is_same(mesh, bone)
    assert not any("skin" in each.change for each in done)


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("height", [-4.0, 0.0, 1.0])
@pytest.mark.parametrize("inward", [True, False])
def test_an_inner_shell_is_filled_and_told_with_its_volume(bone, share, height, inward):
    shell = TriangleMesh(share * bone.vertices + [0, 0, height * (1 - share)], bone.faces[:, :: -1 if inward else 1])
    mesh, done = repair(side_by_side([shell, bone]))
    assert is_same(mesh, bone)
    assert [each.change for each in done] == [
        f"filled an inner shell (cavity) of {abs(shell.volume):.3g} mm3 near (0.00, 0.00, {height * (1 - share):z.2f})"
    ]
    assert done[0].guessed == 0.0


def test_a_cavity_that_comes_out_of_the_part_is_told_to(bone):
    through = TriangleMesh(0.5 * bone.vertices + [2.7, 0, 0], bone.faces[:, ::-1])
    mesh, done = repair(side_by_side([bone, through]))
    assert is_same(mesh, bone)
    assert str(done[0]).endswith("it comes out through the surface")


def test_many_cavities_are_told_in_one_sentence(bone):
    places = [(x, y, z) for x in (-1.5, 1.5) for y in (-1, 1) for z in (-6, 0, 6)]
    pores = [TriangleMesh(0.05 * bone.vertices + place, bone.faces[:, ::-1]) for place in places]
    mesh, done = repair(side_by_side([*pores, bone]))
    assert is_same(mesh, bone)
    assert str(done[0]).startswith("filled 12 inner shells (cavities), 1.")


def test_a_closed_piece_beside_the_part_is_another_part(bone):
    for shift in ([12, 0, 0], [4, 0, 0]):
        with pytest.raises(MeshError, match=r"2 separate parts, the second largest near .*: save the one"):
            repair(side_by_side([bone, TriangleMesh(0.8 * bone.vertices + shift, bone.faces)]))


def test_a_folded_shell_inside_is_not_taken_for_the_part(bone):
    length = np.linalg.norm(bone.vertices, axis=1, keepdims=True)
    folds = 1 - 0.35 * (1 + np.cos(np.arange(len(bone.vertices)) * np.pi))[:, None] * (length > 0)
    rough = TriangleMesh(0.97 * bone.vertices * folds, bone.faces[:, ::-1])
    assert rough.area > bone.area
    mesh, done = repair(side_by_side([rough, bone]))
    assert is_same(mesh, bone)
    assert "inner shell" in str(done[0])


def test_components_meet_at_vertices_and_edges_but_not_across_a_wall(bone):
    for kind, count in (("vertex", 2), ("edge", 2), ("wall", 1)):
        assert components_of(with_debris(bone, kind, 9, 0.3)).max() + 1 == count


def test_the_mesh_as_given_is_compared_without_what_was_left_out(bone):
    given = with_debris(bone, "vertex", 700, 0.5)
    part = prepare_part(given, MeshJob())
    assert len(part.given.faces) == len(bone.faces) + 4
    assert len(part.placed_given.faces) == len(bone.faces)
    assert part.repair_deviation < 1e-12
    assert [len(each.faces) for each in part.left_out] == [4]
    assert part.taken_off is not None
    assert part.taken_off.depth < 1e-5, "open3d's float32"
    assert part.move(np.eye(4)).taken_off is part.taken_off


def test_an_open_sheet_inside_is_dropped_and_told_as_that(bone):
    sheet = keep_faces(TriangleMesh(0.5 * bone.vertices, bone.faces), bone.vertices[bone.faces].mean(1)[:, 2] > 2)
    mesh, done = repair(side_by_side([sheet, bone]))
    assert is_same(mesh, bone)
    assert str(done[0]).startswith("dropped 1 open sheet inside the part, near (")


def test_a_cavity_is_found_in_a_bone_with_a_hole(bone):
    cavity = TriangleMesh(0.4 * bone.vertices, bone.faces[:, ::-1])
    mesh, done = repair(side_by_side([cavity, keep_faces(bone, np.arange(len(bone.faces)) >= 4)]))
    assert faults_of(mesh) == ()
    assert mesh.volume == pytest.approx(bone.volume, rel=0.01)
    assert [each.change.split()[0] for each in done] == ["filled", "closed"]


def test_a_large_mesh_is_decimated_within_the_stated_deviation():
    mesh = ellipsoid(4, 3, 9, rings=120, columns=160)
    fewer, told = decimate(mesh, 8000)
    assert len(fewer.faces) <= 8000 < len(mesh.faces)
    assert max(hausdorff(mesh, fewer)) <= DECIMATION_DEVIATION
    assert not faults_of(fewer)
    assert told[0].change.startswith(f"decimated {len(mesh.faces)} faces to {len(fewer.faces)}, 0.00")
    assert decimate(mesh, len(mesh.faces)) == (mesh, ())


def test_triangles_without_common_vertices_are_decimated_too():
    mesh = ellipsoid(4, 3, 9, rings=80, columns=120)
    loose = TriangleMesh(
        mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size, dtype=np.int32).reshape(-1, 3)
    )
    fewer, _ = decimate(loose, 10000)
    assert len(fewer.faces) <= 10000
    assert fewer.volume == pytest.approx(mesh.volume, rel=1e-3)


def test_a_rough_mesh_is_refused_rather_than_smoothed():
    mesh = ellipsoid(4, 3, 9, rings=60, columns=80)
    rough = np.random.default_rng(1).normal(scale=0.1, size=mesh.vertices.shape)
    with pytest.raises(MeshError, match=r"9600 faces, and decimating it to 1000 moves the surface by 0\.\d+ mm"):
        decimate(TriangleMesh(mesh.vertices + rough, mesh.faces), 500)


def test_a_part_keeps_the_mesh_as_given_and_tells_how_far_repair_moved_it():
    whole = ellipsoid(4, 3, 9)
    part = prepare_part(whole, MeshJob())
    assert part.repair_deviation == 0
    assert np.allclose(part.placed_given.vertices, part.mesh.vertices)
    holed = TriangleMesh(whole.vertices, whole.faces[: -len(whole.faces) // 40])
    part = prepare_part(holed, MeshJob())
    assert part.repairs
    assert len(part.given.faces) == len(holed.faces)
    assert 0.05 < part.repair_deviation < 2


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
def test_a_wall_inside_goes_and_both_sides_of_it_stay(bone, height):
    given = with_wall(bone, height)
    mesh, done = repair(given)
    assert faults_of(mesh) == ()
    assert mesh.volume == pytest.approx(bone.volume, rel=1e-9)
    assert "inside the part" in str(done[0])
    assert done[0].guessed == 0.0
    assert not any("skin" in each.change for each in done)


def test_all_slabs_between_walls_stay(bone):
    for heights in ((-6.0, 4.0), (-11.0, -6.0, 6.5), (9.0, 11.0, 13.0)):
        given = bone
        for height in heights:
            given = with_wall(given, height)
        mesh, done = repair(given)
        assert faults_of(mesh) == ()
        assert mesh.volume == pytest.approx(bone.volume, rel=1e-9)
        assert "inside the part" in str(done[0])


def test_a_sheet_that_sticks_out_goes(bone):
    column = np.arange(32 * 6, 32 * 18, 32)
    outer = len(bone.vertices) + np.arange(len(column))
    vertices = np.concatenate([bone.vertices, bone.vertices[column] + [0.8, 0, 0]])
    strip = [[column[k], column[k + 1], outer[k]] for k in range(len(column) - 1)]
    strip += [[column[k + 1], outer[k + 1], outer[k]] for k in range(len(column) - 1)]
    mesh, done = repair(TriangleMesh(vertices, np.concatenate([bone.faces, strip]).astype(np.int32)))
    assert is_same(mesh, bone)
    assert all(each.outward == each.inward == 0 for each in done)


@pytest.fixture(scope="module")
def phalanx():
    return read_mesh(path("phalanx"))


def without(mesh: TriangleMesh, lost: np.ndarray) -> TriangleMesh:
    return TriangleMesh(mesh.vertices, np.delete(mesh.faces, lost, axis=0))


def test_half_of_a_bone_is_refused_before_its_surface_is_fitted(phalanx):
    half = TriangleMesh(phalanx.vertices, phalanx.faces[: len(phalanx.faces) // 2])
    told = r"30 % .*: dropped 16 .*; closed 66 holes .* near \(.*\(allowed 0\.1\): export the mesh again"
    job = Job(warnings={"hole_refused": 50.0})
    with pytest.raises(LimitError, match=told):
        stand_part(half, job, machine=None, times=StageTimes(), progress=silent)


def test_a_whole_mesh_has_no_guess_and_a_hole_has_its_own_area(phalanx):
    assert repaired_part(phalanx, MeshJob()).guessed_share == 0.0
    middles = phalanx.vertices[phalanx.faces].mean(axis=1)
    lost = np.flatnonzero(np.linalg.norm(middles - middles[100], axis=1) < 1.0)
    gone = np.linalg.norm(phalanx.face_vectors[lost], axis=1).sum() / 2
    share = repaired_part(without(phalanx, lost), MeshJob(facets="exact")).guessed_share
    assert share == pytest.approx(gone / phalanx.area, rel=0.15)


def test_loose_pieces_count_together(phalanx):
    flake = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    vertices, faces = [phalanx.vertices], [phalanx.faces]
    for k in range(30):
        vertices.append(flake + np.array([30.0 + 3 * k, 0.0, 0.0]))
        faces.append(np.arange(3)[None] + len(phalanx.vertices) + 3 * k)
    littered = TriangleMesh(np.vstack(vertices), np.vstack(faces).astype(np.int32))
    assert repaired_part(littered, MeshJob()).guessed_share == pytest.approx(15.0 / phalanx.area, rel=0.01)


def soup_of(mesh: TriangleMesh, spread: float, seed: int = 0) -> TriangleMesh:
    """Every face with corners of its own, each moved by up to `spread` mm along each axis."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    moved = corners + np.random.default_rng(seed).uniform(-spread, spread, corners.shape)
    return TriangleMesh(moved, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))


@pytest.mark.parametrize("shift", [0.0, 1000.0])
@pytest.mark.parametrize("spread", [0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 3e-4])
def test_a_soup_of_triangles_becomes_the_bone(bone, spread, shift):
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
def test_halves_that_share_no_seam_are_joined(bone, gap, axis):
    above = bone.vertices[bone.faces].mean(axis=1)[:, axis] > 0.3
    upper, lower = keep_faces(bone, above), keep_faces(bone, ~above)
    moved = TriangleMesh(upper.vertices + gap * np.eye(3)[axis], upper.faces)
    mesh, done = repair(side_by_side([lower, moved]))
    assert faults_of(mesh) == ()
    assert len(mesh.vertices) == len(bone.vertices)
    assert str(done[0]).startswith("merged ")
    kept = mesh.vertices[:, None] == np.concatenate([lower.vertices, moved.vertices])
    assert kept.all(axis=2).any(axis=1).all()


def test_what_is_closed_is_never_merged(bone):
    near = TriangleMesh(0.05 * bone.vertices + [5.25 + 1e-9, 0, 0], bone.faces)
    both = side_by_side([bone, near])
    assert weld_seams(RepairState(both)).mesh is both


def test_gaps_wider_than_the_tolerance_stay_open(bone):
    with pytest.raises(MeshError, match=r"separate parts.*merge close vertices in a mesh editor"):
        repair(soup_of(bone, 0.05))


def test_no_edge_collapses(bone):
    scaled = TriangleMesh(bone.vertices * [1, 1, 1e-3], bone.faces)
    mesh = weld_seams(RepairState(soup_of(scaled, 1e-7))).mesh
    assert len(mesh.faces) == len(bone.faces)
    assert len(mesh.vertices) == len(bone.vertices)


def test_a_saved_twice_mesh_is_taken_once(bone):
    mesh, done = repair(side_by_side([bone, bone]))
    assert is_same(mesh, bone)
    assert str(done[0]) == f"removed {len(bone.faces)} duplicate faces"


def dented(mesh: TriangleMesh, vertex: int, by: float) -> TriangleMesh:
    """The mesh with one vertex pushed along its direction from the origin."""
    vertices = np.array(mesh.vertices)
    vertices[vertex] *= 1 + by / np.linalg.norm(vertices[vertex])
    return TriangleMesh(vertices, mesh.faces)


@pytest.mark.parametrize("turned", [False, True])
def test_both_sides_are_found_where_one_moved_farther(bone, turned):
    before = dented(dented(bone, 100, 0.3), 500, -0.2)
    after = TriangleMesh(bone.vertices, bone.faces[:, :: -1 if turned else 1])
    moves = surface_moves(before, after)
    assert 0.2 < moves.inward <= 0.3
    assert 0.1 < moves.outward <= 0.2
    assert moves.largest == moves.inward
    assert np.allclose(moves.place, before.vertices[100])


def test_the_smaller_side_is_found_among_many_points_of_the_larger(bone):
    before = dented(TriangleMesh(bone.vertices * 1.05, bone.faces), 300, -0.5)
    moves = surface_moves(before, bone)
    assert moves.inward == pytest.approx(0.7, abs=0.01)
    assert 0.05 < moves.outward < 0.5
    assert surface_moves(bone, bone).largest == 0


def test_what_lies_inside_the_solid_does_not_count(bone):
    inner = TriangleMesh(0.5 * bone.vertices, bone.faces)
    both = side_by_side([bone, inner])
    assert surface_moves(both, bone).outward > 2
    assert surface_moves(both, bone, bone).largest == 0


def test_a_sentence_tells_the_movement_and_the_report_has_it(bone):
    made = Repair.between("changed it", dented(bone, 100, 0.3), bone)
    assert str(made).startswith("changed it; moved the surface 0.000 mm outward, 0.2")
    moved = {"outward_mm": 0.0, "inward_mm": round(made.inward, 6)}
    assert made.report == {"change": "changed it", **moved, "guessed_mm2": 0.0}
    assert str(Repair("changed it", 4e-4, 4e-4)) == "changed it"


def cylinder(low: float, high: float, radius: float = 5.0) -> TriangleMesh:
    return revolve(np.full(2, radius), np.array([low, high]), (low, high), 64)


def test_overlapping_and_separate_solids_become_one_boundary():
    made = solid_union([cylinder(0.0, 10.0), cylinder(6.0, 14.0, 3.0), cylinder(20.0, 22.0)])
    share = cylinder(0.0, 1.0).volume
    assert made.volume == pytest.approx(12 * share + 4 * cylinder(0.0, 1.0, 3.0).volume)
    inside = MeshDistance(made).inside(np.array([[0, 0, 8.0], [4, 0, 8.0], [0, 0, 12.0], [0, 0, 17.0]]))
    assert inside.tolist() == [True, True, True, False]


def test_open_and_inward_meshes_are_refused_by_name_or_number():
    good = cylinder(0.0, 10.0)
    with pytest.raises(MeshError, match="solid 1 is not closed near"):
        solid_union([good, keep_faces(good, slice(1, None))])
    with pytest.raises(MeshError, match=r"hub\.stl is not closed near"):
        solid_union([keep_faces(good, slice(1, None)), good], ["hub.stl", "shroud.stl"])
    with pytest.raises(MeshError, match="solid 0 encloses"):
        solid_union([TriangleMesh(good.vertices, good.faces[:, ::-1])])


def test_a_hole_is_capped_by_faces_whose_vertices_go_where_they_are_told():
    mesh = ellipsoid(5, 4, 14)
    top = mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > mesh.vertices[:, 2].max() - 1.0
    lifted = np.array([0.0, 0.0, 0.5])
    capped = cap(mesh, top, 0.3, lambda points: points + lifted)
    assert capped is not None
    closed, old = capped
    kept = len(old)
    assert (closed.vertices[:kept] == mesh.vertices[old]).all()
    rim = mesh.vertices[mesh.faces[top]].reshape(-1, 3)[:, 2].min()
    assert closed.vertices[kept:, 2].max() > rim + 0.4


def test_faces_that_leave_no_closed_body_are_not_capped():
    mesh = ellipsoid(5, 4, 14)
    heights = mesh.vertices[mesh.faces].mean(axis=1)[:, 2] - mesh.bounds.mean(axis=0)[2]
    assert cap(mesh, np.abs(heights) < 3, 0.3, lambda points: points) is None
