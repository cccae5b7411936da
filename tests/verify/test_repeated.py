"""Distances to a wheel from one of its blades are those of the whole wheel."""

import numpy as np

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.solids import cylinder
from bonecam.mesh.triangle_mesh import side_by_side
from bonecam.surface.blades import turned
from bonecam.verify.readback import RepeatedDistance

COUNT = 5


def test_it_is_the_distance_to_all_copies() -> None:
    pose = np.eye(4)
    pose[:3, 3] = [10.0, 2.0, 0.0]
    one = cylinder(1.5, 0.0, 6.0, 0.05).move(pose)
    whole = side_by_side([turned(one, 2 * np.pi * k / COUNT) for k in range(COUNT)])
    points = np.random.default_rng(3).uniform([-14, -14, -2], [14, 14, 8], (2000, 3))
    wanted = MeshDistance(whole).signed(points)
    found = RepeatedDistance(MeshDistance(one), COUNT).signed(points, 20.0)
    assert (wanted < 0).sum() > 30
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_far_points_are_told_to_be_as_far_as_asked() -> None:
    one = cylinder(1.5, 0.0, 6.0, 0.05)
    found = RepeatedDistance(MeshDistance(one), 3).signed(np.array([[30.0, 0.0, 3.0], [3.0, 0.0, 3.0]]), 5.0)
    np.testing.assert_allclose(found, [5.0, 1.5], atol=0.03)
