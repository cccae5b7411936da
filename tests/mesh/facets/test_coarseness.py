from collections.abc import Callable

import numpy as np
import pytest
from bonecam_meshes import path as shipped

from bonecam.job.mesh_section import COARSEST_FIT
from bonecam.mesh.files.mesh_files import read_mesh
from bonecam.mesh.meshlab import from_meshset, split_edges, to_meshset
from bonecam.mesh.smooth_surface import coarseness_of, convex_hull, is_coarse
from bonecam.mesh.triangle_mesh import TriangleMesh

TOLERANCE = COARSEST_FIT


def prism(sides: int) -> TriangleMesh:
    """An upright prism of radius 5 and height 20."""
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([5 * np.cos(angles), 5 * np.sin(angles), np.zeros(sides)])
    return convex_hull(np.vstack([ring, ring + np.array([0.0, 0.0, 20.0])]))


def test_the_sagitta_is_near_the_distance_of_facets_from_the_sphere_and_falls_with_the_square_of_their_edges(
    ellipsoid: Callable[..., TriangleMesh],
) -> None:
    coarse, fine = (coarseness_of(ellipsoid(10, 10, 10, rings=n, columns=2 * n)) for n in (11, 23))
    assert coarse.sagitta / fine.sagitta == pytest.approx(4.0, rel=0.15)
    assert coarse.edge / fine.edge == pytest.approx(2.0, rel=0.15)
    assert coarse.crease == pytest.approx(np.pi / 12, rel=0.1)
    # a face between rings 15 degrees apart lies up to 10 (1 - cos(7.5 degrees)) = 0.086 mm off the sphere
    assert coarse.sagitta == pytest.approx(0.086, rel=0.3)


@pytest.mark.parametrize("sides", [4, 6, 12, 64])
def test_boxes_prisms_and_cylinders_have_true_edges_and_stay_as_they_are_however_they_are_divided(sides: int) -> None:
    assert coarseness_of(prism(sides)).true_edges
    for edge in (8.0, 3.0, 1.0):
        divided = split_edges(prism(sides), edge)
        assert not is_coarse(divided, coarseness_of(divided), TOLERANCE)


def test_a_round_body_of_plane_quadrangles_has_no_true_edges(ellipsoid: Callable[..., TriangleMesh]) -> None:
    found = coarseness_of(ellipsoid(10, 10, 10, rings=8, columns=16))
    assert not found.true_edges


@pytest.mark.parametrize("faces", [100, 200, 400, 700])
def test_a_bone_of_few_faces_is_coarse_and_the_finely_meshed_one_is_not(faces: int) -> None:
    fine = read_mesh(shipped("phalanx"))
    meshset = to_meshset(fine)
    meshset.meshing_decimation_quadric_edge_collapse(targetfacenum=faces, preservetopology=True)
    coarse = from_meshset(meshset)
    found = coarseness_of(coarse)
    assert is_coarse(coarse, found, TOLERANCE)
    assert not found.true_edges
    assert not is_coarse(fine, coarseness_of(fine), TOLERANCE)


def test_a_mesh_is_coarse_beside_what_is_asked_of_it(ellipsoid: Callable[..., TriangleMesh]) -> None:
    mesh = ellipsoid(10, 10, 10, rings=11, columns=22)
    found = coarseness_of(mesh)
    assert is_coarse(mesh, found, 1.9 * found.sagitta)
    assert not is_coarse(mesh, found, 2.1 * found.sagitta)
