from collections.abc import Callable

import numpy as np

from bonecam.mesh.hollows import cap
from bonecam.mesh.triangle_mesh import TriangleMesh


def test_a_hole_is_capped_by_faces_whose_vertices_go_where_they_are_told(
    ellipsoid: Callable[..., TriangleMesh],
) -> None:
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


def test_faces_that_leave_no_closed_body_are_not_capped(ellipsoid: Callable[..., TriangleMesh]) -> None:
    mesh = ellipsoid(5, 4, 14)
    heights = mesh.vertices[mesh.faces].mean(axis=1)[:, 2] - mesh.bounds.mean(axis=0)[2]
    assert cap(mesh, np.abs(heights) < 3, 0.3, lambda points: points) is None
