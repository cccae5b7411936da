"""What is known of the room round contacts before any tool is marched."""

import numpy as np

from bonecam.planning.axes.free_axes import ROOMS, rooms_at
from bonecam.planning.scene import TANGENT_SLACK, Scene
from bonecam.tool.path import ContactPath


def test_the_largest_empty_ball_at_a_contact_is_that_of_trying_all(made: tuple[ContactPath, Scene]) -> None:
    path, scene = made
    around = scene.around("cutter", path.cutter.radius)
    empty = np.array(
        [
            around.distance_bound(path.centres + more * path.normals, radius, outside=True) >= radius
            for more in ROOMS
            for radius in [np.full(len(path.centres), path.cutter.radius + more - TANGENT_SLACK)]
        ]
    )
    # how many are empty before the first that is not
    count = np.logical_and.accumulate(empty).sum(axis=0)

    assert len(np.unique(count)) > 3
    np.testing.assert_array_equal(rooms_at(path, scene), np.array([0.0, *ROOMS])[count])
