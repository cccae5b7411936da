"""Meshes of other libraries come in and go out."""

from collections.abc import Callable
from typing import Any

import numpy as np
import open3d
import pymeshlab
import pytest
import trimesh

from bonecam import TriangleMesh
from bonecam.job import MeshJob
from bonecam.mesh import mesh_from
from bonecam.mesh.part import repaired_part

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], dtype=np.int32)
MADE_BY: dict[str, Callable[[], Any]] = {
    "arrays": lambda: (CORNERS, FACES),
    "lists": lambda: (CORNERS.tolist(), FACES.tolist()),
    "ours": lambda: TriangleMesh(CORNERS, FACES),
    "open3d": lambda: TriangleMesh(CORNERS, FACES).to_open3d(),
    "open3d tensors": lambda: open3d.t.geometry.TriangleMesh.from_legacy(TriangleMesh(CORNERS, FACES).to_open3d()),
    "trimesh": lambda: TriangleMesh(CORNERS, FACES).to_trimesh(),
    "trimesh's scene": lambda: trimesh.Scene([TriangleMesh(CORNERS, FACES).to_trimesh()]),
    "pymeshlab": lambda: pymeshlab.Mesh(CORNERS, FACES),
}


@pytest.mark.parametrize("library", MADE_BY)
def test_the_mesh_of_a_library_becomes_ours(library):
    mesh = mesh_from(MADE_BY[library]())
    assert np.array_equal(mesh.vertices, CORNERS)
    assert np.array_equal(mesh.faces, FACES)


def test_the_mesh_of_a_library_becomes_a_part():
    part = repaired_part(MADE_BY["trimesh"](), MeshJob(units="inch", upright=False))
    assert part.file == "the mesh"
    np.testing.assert_allclose(part.mesh.bounds[1], 25.4)


def test_our_mesh_leaves_as_copies_that_may_be_changed():
    mesh = TriangleMesh(CORNERS, FACES)
    given = mesh.to_trimesh()
    assert isinstance(given, trimesh.Trimesh)
    given.vertices[0] = 5.0
    given.faces[0] = [0, 1, 2]
    mesh.to_open3d().translate((1.0, 0.0, 0.0))
    assert np.array_equal(mesh.vertices, CORNERS)
    assert np.array_equal(mesh.faces, FACES)


@pytest.mark.parametrize(
    ("source", "error", "told"),
    [
        ({"vertices": CORNERS}, TypeError, r"the mesh is of type dict: give \(vertices, faces\)"),
        (3, TypeError, "the mesh is of type int: give"),
        ((CORNERS, FACES.astype(float)), ValueError, "faces hold float64 numbers: give the indices"),
        ((CORNERS.astype(complex), FACES), ValueError, "vertices hold complex128 values: give numbers"),
        ((CORNERS.astype(str), FACES), ValueError, "vertices hold <U.* values: give numbers"),
        ((CORNERS[:, :2], FACES), ValueError, r"vertices have the shape \(4, 2\): give three numbers a row"),
        ((CORNERS, FACES[0]), ValueError, r"faces have the shape \(3,\)"),
        ((CORNERS, FACES + 1), ValueError, "faces name vertices outside 0..3"),
        ((CORNERS, FACES.astype(np.int64) + 2**32), ValueError, "faces name vertices outside 0..3"),
        ((np.where(CORNERS == 1, np.inf, CORNERS), FACES), ValueError, "is not finite"),
        ((CORNERS * 1e300, FACES), ValueError, r"vertex \d has a coordinate of 1e\+300: give at most"),
    ],
)
def test_what_is_no_mesh_is_refused(source, error, told):
    with pytest.raises(error, match=told):
        mesh_from(source)


def test_a_mesh_is_shown_in_a_line():
    assert repr(TriangleMesh(CORNERS * 3, FACES)) == "TriangleMesh(4 vertices, 4 faces, 3 x 3 x 3 mm)"
    assert (
        repr(TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32)))
        == "TriangleMesh(0 vertices, 0 faces, 0 mm)"
    )


def test_a_scene_of_no_meshes_has_no_faces():
    assert len(mesh_from(trimesh.Scene()).faces) == 0


def test_a_tensor_mesh_of_nothing_has_no_faces():
    mesh = mesh_from(open3d.t.geometry.TriangleMesh())
    assert len(mesh.vertices) == len(mesh.faces) == 0


def test_a_mesh_of_pyvista_comes_in():
    class PolyData:
        """What pyvista 0.44 has of a surface that is no triangles, as its documentation says it."""

        points, faces = CORNERS, np.array([4, 0, 1, 2, 3])

        def extract_surface(self):
            return self

        def triangulate(self):
            made = PolyData()
            made.faces = np.ravel([[3, *face] for face in FACES])
            return made

    assert np.array_equal(mesh_from(PolyData()).faces, FACES)
