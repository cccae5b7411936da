"""The hull is closed, outward and holds its points, also where many of them lie nearly in a plane."""

import numpy as np

from bonecam.mesh.smooth_surface import convex_hull
from bonecam.mesh.triangle_mesh import TriangleMesh


def is_closed(mesh: TriangleMesh) -> bool:
    edges = np.vstack([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    there, back = {tuple(edge) for edge in edges.tolist()}, {tuple(edge) for edge in edges[:, ::-1].tolist()}
    return len(there) == len(edges) and there == back


def test_points_within_the_hull_are_left_out() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 3.0) for z in (0.0, 5.0)])
    hull = convex_hull(np.vstack([corners, [[1.0, 1.0, 1.0]], corners]))
    assert is_closed(hull)
    assert (len(hull.vertices), len(hull.faces)) == (8, 12)
    assert hull.volume == 30.0


def test_the_hull_of_points_nearly_in_planes_is_closed() -> None:
    points = np.random.default_rng(3).integers(0, 9, (3000, 3)) + np.random.default_rng(4).uniform(
        -1e-15, 1e-15, (3000, 3)
    )
    hull = convex_hull(points)
    assert is_closed(hull)
    middles = hull.vertices[hull.faces].mean(1)
    assert ((points[:, None] - middles) * hull.face_vectors).sum(2).max() < 1e-9
