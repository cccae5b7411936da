"""Rows in other frames stay on the mesh, keep their sense of turning, and are ordered by their distortion."""

import os
from pathlib import Path

import numpy as np
import pymeshlab
import pytest
from mesh_bodies import ellipsoid, solid, torus

from bonecam.errors import Cancelled, MeshError
from bonecam.mesh import Rows, TriangleMesh, exact_closest, harmonic_rows, read_mesh, repair, to_mm, upright
from bonecam.mesh.rows import (
    OTHER_FRAMES,
    Isolines,
    distortion,
    end_poles,
    harmonic_field,
    positive_laplacian,
    row_choices,
    row_heights,
    rows_in_frame,
)

BONES = "3midph 3distph 2midph 1mc scaphoid capitate metatarsal1_rv".split()


def forked_bone() -> TriangleMesh:
    mesh = read_mesh(Path(os.path.dirname(pymeshlab.__file__)) / "tests" / "sample_meshes" / "bone.ply")
    return solid(mesh.vertices * 35 / np.ptp(mesh.vertices, axis=0).max(), mesh.faces)


def assert_rows(rows: Rows, mesh: TriangleMesh) -> None:
    flat = rows.points.reshape(-1, 3)
    assert np.abs(exact_closest(mesh, flat)[0] - flat).max() < 1e-9, "rows lie on the mesh"
    sides = np.linalg.norm(np.roll(rows.points, -1, axis=1) - rows.points, axis=2)
    assert sides.max() < 2 * sides.mean(1).max(), "points are evenly spread"
    middle = rows.points.mean(1, keepdims=True)
    turning = np.cross(rows.points - middle, np.roll(rows.points, -1, axis=1) - middle)[..., 2].sum(1)
    assert (turning > 0).all(), "counter-clockwise from above"
    gaps = np.linalg.norm(np.diff(np.concatenate([rows.poles[:1], rows.points[:, 0], rows.poles[1:]]), axis=0), axis=1)
    assert gaps.max() < 4 * np.median(gaps), "the seam does not jump"


@pytest.mark.parametrize("name", BONES)
def test_every_isoline_of_a_real_bone_is_one_loop(shared, name):
    mesh = upright(to_mm(read_mesh(shared / "meshes" / "bones" / f"{name}_m.stl"), "m"))[0]
    assert_rows(harmonic_rows(mesh, 24, 60), mesh)


def test_the_forked_bone_falls_into_single_loops():
    mesh = upright(repair(forked_bone())[0])[0]
    assert_rows(harmonic_rows(mesh), mesh)


@pytest.fixture(scope="module")
def egg():
    return upright(ellipsoid(5, 4, 14, thick_end=0.2))[0]


@pytest.fixture(scope="module")
def rows(egg):
    return harmonic_rows(egg, 16, 40, edge=0.8)


def test_two_runs_give_the_same_rows(egg, rows):
    again = harmonic_rows(egg, 16, 40, edge=0.8)
    assert (again.points == rows.points).all()
    assert (again.poles == rows.poles).all()


def test_rows_are_as_far_apart_as_their_heights_say(rows):
    gaps = np.linalg.norm(np.diff(rows.points, axis=0), axis=2).mean(1)
    wanted = np.diff(rows.heights)
    assert np.abs(gaps / gaps.sum() / (wanted / wanted.sum()) - 1).max() < 0.08
    assert np.allclose(rows.heights, row_heights(16))
    assert rows.heights[0] < 0.6 / 17


def test_normals_of_the_rows_point_outward(rows, egg):
    across = np.roll(rows.points, -1, axis=1) - np.roll(rows.points, 1, axis=1)
    normals = np.cross(across[1:-1], rows.points[2:] - rows.points[:-2])
    _, faces = exact_closest(egg, rows.points[1:-1].reshape(-1, 3))
    assert (np.einsum("ij,ij->i", normals.reshape(-1, 3), egg.face_vectors[faces]) > 0).all()


def test_vertex_parameters_say_where_a_vertex_lies_among_the_rows(rows):
    s, t = rows.vertex_parameters.T
    assert ((s >= 0) & (s < 1)).all()
    assert ((t >= 0) & (t <= 1)).all()
    row = np.interp(t, rows.heights, np.arange(len(rows.heights)))
    low = np.clip(row.astype(int), 0, len(rows.heights) - 2)
    place = s * 40
    k = place.astype(int) % 40
    u, v = (row - low)[:, None], (place - np.floor(place))[:, None]
    q = rows.points
    near = (1 - u) * ((1 - v) * q[low, k] + v * q[low, (k + 1) % 40]) + u * (
        (1 - v) * q[low + 1, k] + v * q[low + 1, (k + 1) % 40]
    )
    between = (t > rows.heights[0]) & (t < rows.heights[-1])
    assert np.linalg.norm(near - rows.mesh.vertices, axis=1)[between].max() < 0.8


def test_the_field_has_no_extremum_but_the_poles(rows):
    poles = end_poles(rows.mesh)
    u = harmonic_field(rows.mesh, poles)
    laplacian = positive_laplacian(rows.mesh)
    free = np.setdiff1d(np.arange(len(u)), poles)
    assert np.abs(laplacian @ u)[free].max() < 1e-9
    assert np.abs(laplacian @ np.ones(len(u))).max() < 1e-9
    assert ((u[free] > 0) & (u[free] < 1)).all()
    isolines = Isolines.of(rows.mesh, u)
    for value in np.quantile(u, np.linspace(0.01, 0.99, 100)):
        loop = isolines.loop(float(value))
        assert np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).sum() == pytest.approx(
            isolines.length(float(value))
        )


def test_a_handle_is_found_as_a_broken_isoline():
    ring = torus()
    tilted = solid(ring.vertices[:, [2, 0, 1]], ring.faces)
    with pytest.raises(MeshError, match="several loops"):
        harmonic_rows(tilted, 8, 20, edge=1.0)


def test_wrong_counts_and_cancelling(egg):
    with pytest.raises(ValueError, match="1 rows"):
        harmonic_rows(egg, 1, 40)
    with pytest.raises(Cancelled):
        harmonic_rows(egg, 16, 40, progress=lambda fraction, message: False)


@pytest.fixture(scope="module")
def wedge():
    return ellipsoid(3, 5, 9, thick_end=0.2)


@pytest.mark.parametrize("frame", OTHER_FRAMES)
def test_rows_in_another_frame_lie_on_the_mesh_and_turn_outwards(wedge, frame):
    assert np.linalg.det(frame) == pytest.approx(1.0)
    rows = rows_in_frame(wedge, frame, 12, 40, 0.8)
    flat = rows.points.reshape(-1, 3)
    assert np.abs(exact_closest(wedge, flat)[0] - flat).max() < 1e-9
    up = frame[2]
    assert ((rows.poles[1] - rows.poles[0]) @ up) > 0
    around = np.roll(rows.points, -1, axis=1) - rows.points
    outward = np.cross(around[:-1], rows.points[1:] - rows.points[:-1])
    assert ((outward * (rows.points[:-1] - wedge.vertices.mean(0))).sum(axis=2) > 0).mean() > 0.99
    seam = rows.points[len(rows.points) // 2, 0]
    assert (rows.points[len(rows.points) // 2] @ frame[0]).max() - seam @ frame[0] < 0.8


def test_the_usual_rows_come_first_and_the_others_by_their_distortion(wedge):
    first, *others = row_choices(wedge, 12, 40, 0.8)
    assert np.array_equal(first.points, harmonic_rows(wedge, 12, 40, 0.8).points)
    measures = [distortion(rows) for rows in others]
    assert measures == sorted(measures)
    across = [rows for rows in others if abs(rows.poles[1] - rows.poles[0])[2] < 3]
    assert len(across) == 2
    assert distortion(others[0]) < min(distortion(rows) for rows in across), "along the long axis"
