"""Distances to a wheel from one of its blades are those of the whole wheel.

Where the removal of a wheel's program is measured: on the hub, not on the floor that goes on beyond it.
"""

import numpy as np
import pytest
from small_wheel import EDGES, HALF, PROFILE, blade

from bonecam.mesh import MeshDistance
from bonecam.mesh.solids import cylinder
from bonecam.wheels.proof import RepeatedDistance, wheel_probes
from bonecam.wheels.wheel import channel_of, meridional, places_on, point_at, repeated, wheel_of

COUNT = 5


def test_it_is_the_distance_to_all_copies():
    pose = np.eye(4)
    pose[:3, 3] = [10.0, 2.0, 0.0]
    one = cylinder(1.5, 0.0, 6.0, 0.05).move(pose)
    whole = repeated(one, COUNT)
    points = np.random.default_rng(3).uniform([-14, -14, -2], [14, 14, 8], (2000, 3))
    wanted = MeshDistance(whole).signed(points)
    found = RepeatedDistance(MeshDistance(one), COUNT).signed(points, 20.0)
    assert (wanted < 0).sum() > 30
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_far_points_are_told_to_be_as_far_as_asked():
    one = cylinder(1.5, 0.0, 6.0, 0.05)
    found = RepeatedDistance(MeshDistance(one), 3).signed(np.array([[30.0, 0.0, 3.0], [3.0, 0.0, 3.0]]), 5.0)
    np.testing.assert_allclose(found, [5.0, 1.5], atol=0.03)


WHEEL_REACH = 2.0
CONE = PROFILE[3] - PROFILE[2]
END = 0.05
"""Probes stand at least this far from the hub's edges, mm."""


@pytest.fixture(scope="module")
def wheel():
    return wheel_of(blade(), PROFILE, 2)


@pytest.fixture(scope="module")
def on_hub(wheel):
    """Meridional places of the probes beside the blades."""
    channel = channel_of(wheel, WHEEL_REACH)
    beyond = meridional(channel.floor.positions(np.array([0.5]), channel.floor.domain[1][1:]))
    assert beyond[0, 1] > PROFILE[3, 1] + 0.3, "the floor of this wheel goes on beyond the hub"
    points = wheel_probes(wheel, channel.floor).points
    return meridional(points[np.abs(points[:, 1]) > HALF + 0.2])


def test_no_probe_stands_where_the_floor_has_left_the_hub(on_hub):
    off = np.linalg.norm(on_hub - point_at(PROFILE, places_on(PROFILE, on_hub)), axis=1)
    assert off.max() < 1e-9
    share = (on_hub - PROFILE[2]) @ CONE / (CONE @ CONE)
    assert share.max() < 1 - END / np.linalg.norm(CONE)


def test_probes_reach_beyond_the_blades_to_the_hub_s_end(on_hub):
    share = (on_hub - PROFILE[2]) @ CONE / (CONE @ CONE)
    assert share.max() > max(EDGES[1], 1 - 0.6 / np.linalg.norm(CONE))
    assert share.min() < EDGES[0]
