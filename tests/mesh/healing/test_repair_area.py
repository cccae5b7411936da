"""What repairs close, drop or make anew is measured as area, and refused where it is much of the part."""

import numpy as np
import pytest
from bonecam_meshes import path

from bonecam.errors import LimitError
from bonecam.job import Job, MeshJob
from bonecam.machining import stand_part
from bonecam.mesh.files.mesh_files import read_mesh
from bonecam.mesh.part import repaired_part
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import silent
from bonecam.runtime.timing import StageTimes


@pytest.fixture(scope="module")
def phalanx() -> TriangleMesh:
    return read_mesh(path("phalanx"))


def without(mesh: TriangleMesh, lost: np.ndarray) -> TriangleMesh:
    return TriangleMesh(mesh.vertices, np.delete(mesh.faces, lost, axis=0))


def test_half_of_a_bone_is_refused_before_its_surface_is_fitted(phalanx: TriangleMesh) -> None:
    half = TriangleMesh(phalanx.vertices, phalanx.faces[: len(phalanx.faces) // 2])
    told = r"30 % .*: dropped 16 .*; closed 66 holes .* near \(.*\(allowed 0\.1\): export the mesh again"
    job = Job(warnings={"hole_refused": 50.0})
    with pytest.raises(LimitError, match=told):
        stand_part(half, job, machine=None, times=StageTimes(), progress=silent)


def test_a_whole_mesh_has_no_guess_and_a_hole_has_its_own_area(phalanx: TriangleMesh) -> None:
    assert repaired_part(phalanx, MeshJob()).guessed_share == 0.0
    middles = phalanx.vertices[phalanx.faces].mean(axis=1)
    lost = np.flatnonzero(np.linalg.norm(middles - middles[100], axis=1) < 1.0)
    gone = np.linalg.norm(phalanx.face_vectors[lost], axis=1).sum() / 2
    share = repaired_part(without(phalanx, lost), MeshJob(facets="exact")).guessed_share
    assert share == pytest.approx(gone / phalanx.area, rel=0.15)


def test_loose_pieces_count_together(phalanx: TriangleMesh) -> None:
    flake = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    vertices, faces = [phalanx.vertices], [phalanx.faces]
    for k in range(30):
        vertices.append(flake + np.array([30.0 + 3 * k, 0.0, 0.0]))
        faces.append(np.arange(3)[None] + len(phalanx.vertices) + 3 * k)
    littered = TriangleMesh(np.vstack(vertices), np.vstack(faces).astype(np.int32))
    assert repaired_part(littered, MeshJob()).guessed_share == pytest.approx(15.0 / phalanx.area, rel=0.01)
