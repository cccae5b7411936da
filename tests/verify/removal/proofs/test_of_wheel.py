"""Where the removal of a wheel's program is measured: on the hub, not on the floor that goes on beyond it."""

import numpy as np
import pytest
from small_wheel import EDGES, HALF, PROFILE, blade

from bonecam.surface.blades import Wheel, channel_of, meridional, places_on, point_at, wheel_of
from bonecam.verify.proof import wheel_probes

COUNT = 2
REACH = 2.0
CONE = PROFILE[3] - PROFILE[2]
END = 0.05
"""Probes stand at least this far from the hub's edges, mm."""


@pytest.fixture(scope="module")
def wheel() -> Wheel:
    return wheel_of(blade(), PROFILE, COUNT)


@pytest.fixture(scope="module")
def on_hub(wheel: Wheel) -> np.ndarray:
    """Meridional places of the probes beside the blades."""
    channel = channel_of(wheel, REACH)
    beyond = meridional(channel.floor.positions(np.array([0.5]), channel.floor.domain[1][1:]))
    assert beyond[0, 1] > PROFILE[3, 1] + 0.3, "the floor of this wheel goes on beyond the hub"
    points = wheel_probes(wheel, channel.floor).points
    return meridional(points[np.abs(points[:, 1]) > HALF + 0.2])


def test_no_probe_stands_where_the_floor_has_left_the_hub(on_hub: np.ndarray) -> None:
    off = np.linalg.norm(on_hub - point_at(PROFILE, places_on(PROFILE, on_hub)), axis=1)
    assert off.max() < 1e-9
    share = (on_hub - PROFILE[2]) @ CONE / (CONE @ CONE)
    assert share.max() < 1 - END / np.linalg.norm(CONE)


def test_probes_reach_beyond_the_blades_to_the_hub_s_end(on_hub: np.ndarray) -> None:
    share = (on_hub - PROFILE[2]) @ CONE / (CONE @ CONE)
    assert share.max() > max(EDGES[1], 1 - 0.6 / np.linalg.norm(CONE))
    assert share.min() < EDGES[0]
