"""The schedule of feeds on loads with known answers."""

import numpy as np
import pytest

from bonecam.mechanics.loads import LEAST, MOST, PathLoads, feed_schedule
from bonecam.tool.path import PARTING


def loads(peak, edge_share, index=0):
    """A path whose moves take the same time, each with its peak (N)."""
    count = len(peak)
    rest = [np.ones(count) for _ in range(2)]
    peak, share = np.array(peak), np.full(count, edge_share)
    return PathLoads(index, 0, np.arange(count), np.full(count, 0.1), peak / 2, peak, share, *rest, 900.0, 150.0)


def test_the_part_that_grows_with_the_feed_makes_every_peak_the_same() -> None:
    found = feed_schedule([loads([20.0, 30.0, 40.0, 50.0], 0.5)], [1], 5)
    assert found.targets == {1: 40.0}
    edge, grows = np.array([10.0, 15, 20, 25]), np.array([10.0, 15, 20, 25])
    assert edge + found.ratios[:4] * grows == pytest.approx([30.0, 40, 40, 40])  # twice the feed at most
    assert found.ratios[4] == 1.0, "in air"


def test_feeds_stay_within_half_and_twice_and_parting_keeps_its_own() -> None:
    paths = [loads([10.0, 10.0, 10.0, 100.0], 0.8), loads([500.0], 0.1, PARTING)]
    found = feed_schedule(paths, [2, 2], 4)
    assert found.targets == {2: 10.0}
    assert found.ratios.tolist() == [1.0, 1.0, 1.0, LEAST]
    assert feed_schedule([loads([1.0, 8.0, 8.0, 8.0], 0.0)], [1], 4).ratios[0] == MOST
