"""A mesh that cuts itself in a few faces is smoothed there, and only there."""

from collections.abc import Callable

import numpy as np

from bonecam.mesh.facets.untangle import untangled
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh


def test_a_vertex_that_went_through_its_neighbours_comes_back_and_far_ones_stay(
    ellipsoid: Callable[..., TriangleMesh],
) -> None:
    smooth = ellipsoid(5, 4, 14, rings=40, columns=48)
    near = np.linalg.norm(smooth.vertices - [5.0, 0.0, 0.0], axis=1) < 1.0
    noise = np.random.default_rng(3).normal(size=smooth.vertices.shape) * near[:, None]
    mesh = TriangleMesh(smooth.vertices + 0.5 * noise, smooth.faces)
    assert len(self_intersections(mesh))
    found = untangled(mesh)
    assert not len(self_intersections(found))
    moved = np.linalg.norm(found.vertices - mesh.vertices, axis=1) > 0
    assert np.linalg.norm(smooth.vertices[moved] - [5.0, 0.0, 0.0], axis=1).max() < 5.0
    assert np.linalg.norm(found.vertices - smooth.vertices, axis=1).max() < 1.5


def test_a_mesh_that_does_not_cut_itself_and_one_that_does_all_over_stay(
    ellipsoid: Callable[..., TriangleMesh],
) -> None:
    smooth = ellipsoid(5, 4, 14, rings=20, columns=24)
    assert untangled(smooth) is smooth
    rng = np.random.default_rng(3)
    wild = TriangleMesh(smooth.vertices + rng.normal(size=smooth.vertices.shape), smooth.faces)
    assert untangled(wild) is wild
