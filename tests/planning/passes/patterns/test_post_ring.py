"""The ring round the post, against the post itself."""

import numpy as np
import pytest

from bonecam.arrays import dots
from bonecam.planning.patterns import LONGEST, OUTSIDE, post_rings
from bonecam.workholding.post import Post, post_below


@pytest.mark.parametrize("radius", [1.0, 2.0])
def test_the_ball_stands_beside_the_post_all_round(pebble, mesh_of, holding, radius):
    surface = pebble()
    post = post_below(mesh_of(surface), holding)
    (ring,) = post_rings(surface, post, radius, radius + 0.1)
    assert ring is not None
    centres = ring.contacts + radius * ring.normals
    assert post.distance(centres) == pytest.approx(radius + 0.1 + OUTSIDE, abs=1e-6)
    middles = (centres[1:] + centres[:-1]) / 2
    assert post.distance(middles).min() > radius + 0.1 - 0.01
    assert ring.contacts[0] == pytest.approx(ring.contacts[-1], abs=1e-9)
    assert np.abs(dots(ring.feeds, ring.normals)).max() < 1e-12


def test_a_post_beside_the_part_has_no_ring(pebble):
    assert post_rings(pebble(), Post(1.0, 10.0), 1.0, 1.1) == []


def test_where_the_lower_lobe_is_narrower_than_the_post_the_ring_jumps_to_the_upper_one_and_is_parted(revolved):
    def lobes(share, azimuth):
        bulge = (1.4 + 0.8 * np.cos(2 * azimuth)) * np.exp(-(((share - 0.2) / 0.1) ** 2))
        return 2.6 + bulge + 4.0 * np.clip((share - 0.4) / 0.3, 0, 1) - 2.4 * np.clip((share - 0.95) / 0.05, 0, 1)

    surface = revolved(lobes, rows=24, around=24)
    rings = post_rings(surface, Post(3.6, 38.5), 1.0, 1.1)
    assert len(rings) == 4, "two parts on each lobe"
    heights = []
    for ring in rings:
        centres = ring.contacts + ring.normals
        assert Post(3.6, 38.5).distance(centres) == pytest.approx(1.1 + OUTSIDE, abs=1e-6)
        assert np.linalg.norm(np.diff(centres, axis=0), axis=1).max() <= LONGEST
        assert np.linalg.norm(ring.contacts[0] - ring.contacts[-1]) > LONGEST, "open"
        heights.append(np.ptp(centres[:, 2]))
    assert max(heights) < 3.0
