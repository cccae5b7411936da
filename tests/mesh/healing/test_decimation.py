"""Meshes of many faces come down to what the later stages need, measured."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.errors import MeshError
from bonecam.job import MeshJob
from bonecam.mesh.distance import hausdorff
from bonecam.mesh.healing import DECIMATION_DEVIATION, decimate, faults_of
from bonecam.mesh.part import prepare_part
from bonecam.mesh.triangle_mesh import TriangleMesh


def test_a_large_mesh_is_decimated_within_the_stated_deviation(ellipsoid: Callable[..., TriangleMesh]) -> None:
    mesh = ellipsoid(4, 3, 9, rings=120, columns=160)
    fewer, told = decimate(mesh, 8000)
    assert len(fewer.faces) <= 8000 < len(mesh.faces)
    assert max(hausdorff(mesh, fewer)) <= DECIMATION_DEVIATION
    assert not faults_of(fewer)
    assert told[0].change.startswith(f"decimated {len(mesh.faces)} faces to {len(fewer.faces)}, 0.00")
    assert decimate(mesh, len(mesh.faces)) == (mesh, ())


def test_triangles_without_common_vertices_are_decimated_too(ellipsoid: Callable[..., TriangleMesh]) -> None:
    mesh = ellipsoid(4, 3, 9, rings=80, columns=120)
    loose = TriangleMesh(
        mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size, dtype=np.int32).reshape(-1, 3)
    )
    fewer, _ = decimate(loose, 10000)
    assert len(fewer.faces) <= 10000
    assert fewer.volume == pytest.approx(mesh.volume, rel=1e-3)


def test_a_rough_mesh_is_refused_rather_than_smoothed(ellipsoid: Callable[..., TriangleMesh]) -> None:
    mesh = ellipsoid(4, 3, 9, rings=60, columns=80)
    rough = np.random.default_rng(1).normal(scale=0.1, size=mesh.vertices.shape)
    with pytest.raises(MeshError, match=r"9600 faces, and decimating it to 1000 moves the surface by 0\.\d+ mm"):
        decimate(TriangleMesh(mesh.vertices + rough, mesh.faces), 500)


def test_a_part_keeps_the_mesh_as_given_and_tells_how_far_repair_moved_it(
    ellipsoid: Callable[..., TriangleMesh],
) -> None:
    whole = ellipsoid(4, 3, 9)
    part = prepare_part(whole, MeshJob(pits="keep"))
    assert part.repair_deviation == 0
    assert np.allclose(part.placed_given.vertices, part.mesh.vertices)
    holed = TriangleMesh(whole.vertices, whole.faces[: -len(whole.faces) // 40])
    part = prepare_part(holed, MeshJob(pits="keep"))
    assert part.repairs
    assert len(part.given.faces) == len(holed.faces)
    assert 0.05 < part.repair_deviation < 2
