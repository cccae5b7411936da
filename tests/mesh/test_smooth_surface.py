"""The hull is closed, outward and holds its points, also where many of them lie nearly in a plane.

Above and below facets, near them and far out.
"""

from pathlib import Path

import numpy as np
import pytest
from bonecam_meshes import path as shipped
from mesh_bodies import ellipsoid

from bonecam.arrays import unit
from bonecam.errors import MeshError
from bonecam.job import MeshJob, SurfaceJob
from bonecam.job.mesh_section import COARSEST_FIT
from bonecam.mesh import (
    MeshDistance,
    Smoothing,
    TriangleMesh,
    coarseness_of,
    delaunay,
    heights_above,
    prepare_part,
    read_mesh,
    repair,
    repaired_part,
    self_intersections,
    smooth_facets,
)
from bonecam.mesh.meshlab import from_meshset, split_edges, to_meshset
from bonecam.mesh.smooth_surface import FINE, convex_hull, is_coarse
from bonecam.mesh.triangle_mesh import probes

TOLERANCE = 0.08
BOX = np.array([[x, y, z] for x in (-5.0, 5.0) for y in (-6.0, 6.0) for z in (-15.0, 15.0)])


@pytest.fixture(scope="module")
def phalanx():
    return read_mesh(shipped("phalanx"))


def with_faces(mesh: TriangleMesh, faces: int, *, on_surface: bool) -> TriangleMesh:
    """A copy with so many faces: its vertices stay `on_surface`, or move out of it to keep the volume."""
    meshset = to_meshset(mesh)
    meshset.meshing_decimation_quadric_edge_collapse(
        targetfacenum=faces, preservenormal=True, preservetopology=True, optimalplacement=not on_surface
    )
    return repair(from_meshset(meshset))[0]


def smoothed(mesh: TriangleMesh) -> Smoothing:
    found = smooth_facets(mesh, coarseness_of(mesh), MeshJob(), TOLERANCE)
    assert found is not None
    return found


def mean_distance(mesh: TriangleMesh, other: TriangleMesh) -> float:
    """Between two surfaces, both ways, mm."""
    there, back = MeshDistance(other).unsigned(probes(mesh)), MeshDistance(mesh).unsigned(probes(other))
    return float((there.mean() + back.mean()) / 2)


@pytest.mark.parametrize("faces", [130, 200, 400, 700])
@pytest.mark.parametrize("on_surface", [True, False])
def test_the_smooth_surface_of_a_coarse_copy_is_nearer_to_the_bone_than_its_facets_and_keeps_more_of_its_volume(
    phalanx, faces, on_surface
):
    coarse = with_faces(phalanx, faces, on_surface=on_surface)
    found = smoothed(coarse)
    assert mean_distance(found.mesh, phalanx) < mean_distance(coarse, phalanx)
    assert abs(found.mesh.volume - phalanx.volume) < abs(coarse.volume - phalanx.volume)


def test_its_facets_are_fine_beside_the_tolerance_and_have_no_creases_left(phalanx):
    coarse = with_faces(phalanx, 200, on_surface=False)
    found = smoothed(coarse)
    before, after = coarseness_of(coarse), coarseness_of(found.mesh)
    assert after.sagitta < 2 * FINE * TOLERANCE
    assert after.crease < before.crease / 3


def test_the_distances_told_are_those_between_the_two_surfaces(phalanx):
    found = smoothed(with_faces(phalanx, 200, on_surface=False))
    shares = np.random.default_rng(5).dirichlet([1.0, 1.0, 1.0], (200, 1))
    corners = found.faceted.vertices[found.faceted.faces]
    points = np.einsum("pnc,fcd->pfd", shares, corners).reshape(-1, 3)
    distance = MeshDistance(found.mesh)
    away, inside = distance.unsigned(points), distance.inside(points)
    assert away[inside].max() <= found.outward + 0.01
    assert away[~inside].max() <= found.inward + 0.01
    assert found.largest <= away.max() + 0.1
    assert found.mean == pytest.approx(away.mean(), rel=0.35)
    told = str(found.change)
    assert f"{found.largest:.2f} mm from them at most" in told
    assert f"{found.mean:.3f} mm on average" in told


def test_a_surface_farther_from_the_facets_than_allowed_is_refused_and_its_remedies_are_right(phalanx):
    coarse = with_faces(phalanx, 130, on_surface=False)
    far = smoothed(coarse).largest
    with pytest.raises(
        MeshError, match=r"facets are coarser or rougher .* allowed 0\.1: raise mesh.smooth_within"
    ) as told:
        prepare_part(coarse, MeshJob(smooth_within=0.1))
    assert told.value.evidence["error"] == pytest.approx(far)
    assert prepare_part(coarse, MeshJob(smooth_within=far + 0.01)).smoothing is not None
    assert prepare_part(coarse, MeshJob(smooth_within=0.1, facets="exact")).smoothing is None


def test_a_tip_that_it_would_leave_too_far_behind_is_drawn_within_the_limit_and_the_rest_stays():
    ball = voxels(6.0, 2.0)
    tip = int(np.argmax(ball.vertices[:, 2]))
    moves = np.zeros_like(ball.vertices)
    moves[tip, 2] = 6.0
    spike = TriangleMesh(ball.vertices + moves, ball.faces)
    plain, drawn = (
        smooth_facets(spike, coarseness_of(spike), MeshJob(facets="smooth", smooth_within=within), TOLERANCE)
        for within in (9.0, 1.5)
    )
    assert plain is not None
    assert drawn is not None
    assert plain.largest > 2.0
    assert drawn.largest <= 1.5
    moved = np.linalg.norm(drawn.mesh.vertices - plain.mesh.vertices, axis=1)
    far = np.linalg.norm(plain.mesh.vertices - spike.vertices[tip], axis=1) > 9.0
    assert far.any()
    assert moved.max() > 0.3
    assert not moved[far].any()


def test_where_a_smooth_surface_cuts_itself_beside_a_sliver_the_facets_are_kept_there_alone():
    even = ellipsoid(5, 4, 14, rings=10, columns=12)
    split = 77
    first, second, third = (int(corner) for corner in even.faces[split])
    has_both = np.isin(even.faces, (first, second)).sum(axis=1) == 2
    across = int(np.setdiff1d(np.flatnonzero(has_both), [split])[0])
    fourth = int(np.setdiff1d(even.faces[across], [first, second])[0])
    start, end, aside = even.vertices[[first, second, third]]
    along, out = unit(np.array([end - start, np.cross(end - start, aside - start)]))
    offset = -0.41 * along + 0.01 * out + 0.91 * np.cross(out, along)
    near = start + 0.3 * np.linalg.norm(end - start) * offset
    new = len(even.vertices)
    slivers = [(first, new, third), (new, second, third), (new, first, fourth), (second, new, fourth)]
    faces = np.vstack([np.delete(even.faces, [split, across], axis=0), np.array(slivers, dtype=np.int32)])
    mesh = TriangleMesh(np.vstack([even.vertices, near]), faces)

    found = smoothed(mesh)
    assert not len(self_intersections(found.mesh))
    assert 0.0 < found.kept < 0.1 * mesh.area
    assert f"{found.kept:.2g} mm2 of them kept where it would cut itself" in str(found.change)
    assert found.report["kept_mm2"] == pytest.approx(found.kept, abs=1e-6)
    far = np.linalg.norm(found.mesh.vertices - start, axis=1) > 16.0
    apart = MeshDistance(smoothed(even).mesh).unsigned(found.mesh.vertices[far])
    assert apart.max() < 1e-9
    assert smoothed(even).kept == 0.0


def test_the_walls_of_a_narrow_slit_keep_their_facets():
    outline = [(-4, 0), (4, 0), (4, 20), (0.05, 20), (0.05, 4), (-0.05, 4), (-0.05, 20), (-4, 20)]
    ring = np.array([(x, 0.0, z) for x, z in outline])
    sides = [(k, (k + 1) % 8) for k in range(8)]
    cap = [(0, 1, 4), (0, 4, 5), (1, 2, 3), (1, 3, 4), (0, 5, 6), (0, 6, 7)]
    faces = [face for a, b in sides for face in ((a, b, b + 8), (a, b + 8, a + 8))]
    faces += [(a, c, b) for a, b, c in cap] + [(a + 8, b + 8, c + 8) for a, b, c in cap]
    mesh = TriangleMesh(np.vstack([ring, ring + np.array([0.0, 5.0, 0.0])]), np.array(faces, dtype=np.int32))
    mesh = mesh if mesh.volume > 0 else TriangleMesh(mesh.vertices, mesh.faces[:, ::-1].copy())
    found = smooth_facets(mesh, coarseness_of(mesh), MeshJob(facets="smooth", smooth_within=50.0), TOLERANCE)
    assert found is not None
    assert not len(self_intersections(found.mesh))
    assert found.kept > 2 * 16 * 5


def test_facets_that_cut_themselves_are_refused_with_their_place():
    even = ellipsoid(5, 4, 14, rings=10, columns=12)
    points = even.vertices.copy()
    points[60] *= -4.0
    mesh = TriangleMesh(points, even.faces)
    with pytest.raises(MeshError, match=r"the facets cut themselves near \(.*mend the mesh there"):
        smooth_facets(mesh, coarseness_of(mesh), MeshJob(facets="smooth", smooth_within=50.0), TOLERANCE)


@pytest.mark.parametrize("name", ["3midph", "1mc", "scaphoid", "capitate"])
def test_finely_meshed_bones_that_are_coarse_beside_a_narrow_tolerance_keep_slivers_only(shared, name):
    part = repaired_part(
        shared / "meshes" / "bones" / f"{name}_m.stl", MeshJob(units="m"), surface=SurfaceJob(tolerance=0.02)
    )
    assert part.smoothing is not None
    assert not len(self_intersections(part.smoothing.mesh))
    assert 0.0 < part.smoothing.kept < 0.001 * part.mesh.area


def test_a_part_with_true_edges_is_kept_and_told_and_rounded_only_where_asked():
    box = convex_hull(BOX)
    part = prepare_part(box, MeshJob(upright=False))
    assert part.smoothing is None
    assert np.array_equal(part.mesh.vertices, box.vertices)
    assert any("true edges part planes" in note for note in part.notes)
    rounded = prepare_part(box, MeshJob(upright=False, facets="smooth", smooth_within=10.0))
    assert rounded.smoothing is not None
    assert not any("true edges" in note for note in rounded.notes)


def test_coarse_facets_that_are_kept_as_asked_are_told(phalanx):
    coarse = with_faces(phalanx, 200, on_surface=False)
    part = repaired_part(coarse, MeshJob(facets="exact"))
    assert any(note.startswith("facets kept as asked: edges of ") for note in part.notes)
    assert not part.repairs


def assert_kept(file: Path, units: str) -> None:
    found, exact = (prepare_part(file, MeshJob(units=units, facets=facets)) for facets in ("found", "exact"))
    assert found.smoothing is None
    assert np.array_equal(found.mesh.vertices, exact.mesh.vertices)
    assert np.array_equal(found.mesh.faces, exact.mesh.faces)
    assert found.notes == exact.notes == ()


def test_the_phalanx_stays_to_the_bit():
    assert_kept(shipped("phalanx"), "mm")


@pytest.mark.parametrize(
    "name",
    ["3midph", "2midph", "scaphoid", *(pytest.param(name, marks=pytest.mark.slow) for name in ("1mc", "capitate"))],
)
def test_finely_meshed_bones_stay_to_the_bit(shared, name):
    assert_kept(shared / "meshes" / "bones" / f"{name}_m.stl", "m")


def test_a_coarse_round_body_is_nearer_to_the_ellipsoid():
    coarse, fine = ellipsoid(5, 4, 14, rings=8, columns=10), ellipsoid(5, 4, 14, rings=120, columns=160)
    found = smoothed(coarse)
    assert mean_distance(found.mesh, fine) < 0.6 * mean_distance(coarse, fine)
    assert coarse.volume < found.mesh.volume < fine.volume


def test_noise_is_taken_off_within_its_own_size(phalanx):
    rng = np.random.default_rng(7)
    noisy = TriangleMesh(phalanx.vertices + 0.06 * rng.normal(size=phalanx.vertices.shape), phalanx.faces)
    assert coarseness_of(noisy).noise
    found = smoothed(noisy)
    assert mean_distance(found.mesh, phalanx) < 0.85 * mean_distance(noisy, phalanx)
    assert found.largest < 0.3
    assert found.mesh.volume == pytest.approx(phalanx.volume, rel=0.02)
    assert "noise of 0.0" in str(found.change)
    assert smooth_facets(noisy, coarseness_of(noisy), MeshJob(), 0.4) is None


def test_the_steps_of_voxels_are_taken_off_within_half_a_voxel():
    pitch, radius = 0.5, 6.0
    sphere = voxels(radius, pitch)
    measure = coarseness_of(sphere)
    assert measure.steps
    assert not measure.true_edges
    found = smoothed(sphere)
    off = np.abs(np.linalg.norm(found.mesh.vertices, axis=1) - radius)
    assert off.mean() < 0.7 * np.abs(np.linalg.norm(sphere.vertices, axis=1) - radius).mean()
    assert found.largest < 0.6 * pitch
    assert "steps of voxels" in str(found.change)


def voxels(radius: float, pitch: float) -> TriangleMesh:
    """The surface between the voxels inside a ball about the origin and those outside, by marching cubes."""
    import igl

    count = 2 * int(np.ceil(radius / pitch)) + 5
    line = (np.arange(count) - (count - 1) / 2) * pitch
    z, y, x = np.meshgrid(line, line, line, indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    inside = (np.linalg.norm(places, axis=1) < radius).astype(np.float64)
    vertices, faces = igl.marching_cubes(inside, places, count, count, count, 0.5)[:2]
    mesh = TriangleMesh(vertices, faces.astype(np.int32))
    return mesh if mesh.volume > 0 else TriangleMesh(vertices, faces[:, ::-1].astype(np.int32))


COARSEST = COARSEST_FIT


def prism(sides: int) -> TriangleMesh:
    """An upright prism of radius 5 and height 20."""
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([5 * np.cos(angles), 5 * np.sin(angles), np.zeros(sides)])
    return convex_hull(np.vstack([ring, ring + np.array([0.0, 0.0, 20.0])]))


def test_the_sagitta_is_near_the_distance_of_facets_from_the_sphere_and_falls_with_the_square_of_their_edges():
    coarse, fine = (coarseness_of(ellipsoid(10, 10, 10, rings=n, columns=2 * n)) for n in (11, 23))
    assert coarse.sagitta / fine.sagitta == pytest.approx(4.0, rel=0.15)
    assert coarse.edge / fine.edge == pytest.approx(2.0, rel=0.15)
    assert coarse.crease == pytest.approx(np.pi / 12, rel=0.1)
    # a face between rings 15 degrees apart lies up to 10 (1 - cos(7.5 degrees)) = 0.086 mm off the sphere
    assert coarse.sagitta == pytest.approx(0.086, rel=0.3)


@pytest.mark.parametrize("sides", [4, 6, 12, 64])
def test_boxes_prisms_and_cylinders_have_true_edges_and_stay_as_they_are_however_they_are_divided(sides):
    assert coarseness_of(prism(sides)).true_edges
    for edge in (8.0, 3.0, 1.0):
        divided = split_edges(prism(sides), edge)
        assert not is_coarse(divided, coarseness_of(divided), COARSEST)


def test_a_round_body_of_plane_quadrangles_has_no_true_edges():
    found = coarseness_of(ellipsoid(10, 10, 10, rings=8, columns=16))
    assert not found.true_edges


@pytest.mark.parametrize("faces", [100, 200, 400, 700])
def test_a_bone_of_few_faces_is_coarse_and_the_finely_meshed_one_is_not(faces):
    fine = read_mesh(shipped("phalanx"))
    meshset = to_meshset(fine)
    meshset.meshing_decimation_quadric_edge_collapse(targetfacenum=faces, preservetopology=True)
    coarse = from_meshset(meshset)
    found = coarseness_of(coarse)
    assert is_coarse(coarse, found, COARSEST)
    assert not found.true_edges
    assert not is_coarse(fine, coarseness_of(fine), COARSEST)


def is_closed(mesh: TriangleMesh) -> bool:
    edges = np.vstack([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    there, back = {tuple(edge) for edge in edges.tolist()}, {tuple(edge) for edge in edges[:, ::-1].tolist()}
    return len(there) == len(edges) and there == back


def test_points_within_the_hull_are_left_out():
    corners = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 3.0) for z in (0.0, 5.0)])
    hull = convex_hull(np.vstack([corners, [[1.0, 1.0, 1.0]], corners]))
    assert is_closed(hull)
    assert (len(hull.vertices), len(hull.faces)) == (8, 12)
    assert hull.volume == 30.0


def test_the_hull_of_points_nearly_in_planes_is_closed():
    points = np.random.default_rng(3).integers(0, 9, (3000, 3)) + np.random.default_rng(4).uniform(
        -1e-15, 1e-15, (3000, 3)
    )
    hull = convex_hull(points)
    assert is_closed(hull)
    middles = hull.vertices[hull.faces].mean(1)
    assert ((points[:, None] - middles) * hull.face_vectors).sum(2).max() < 1e-9


PLACES = np.random.default_rng(5).random((80, 2)) * 10
BOWL = TriangleMesh(np.column_stack([PLACES, ((PLACES - 5) ** 2).sum(axis=1) / 10]), delaunay(PLACES))


def test_locations_along_the_normal_are_above_and_against_it_below():
    up = np.array([0.0, 0.0, 1.0])
    assert (heights_above(BOWL.vertices + 0.5 * up, BOWL) > 0).all()
    assert (heights_above(BOWL.vertices - 0.5 * up, BOWL) < 0).all()


def test_a_location_that_dives_under_a_neighbour_is_not_above():
    """On its contact's outer side, yet below the rising side of the bowl."""
    lowest = int(np.argmin(BOWL.vertices[:, 2]))
    location = BOWL.vertices.copy()
    location[lowest] += [3.0, 0.0, 0.3]
    assert heights_above(location, BOWL)[lowest] < 0
