"""The ring round the post, against the post itself."""

import numpy as np
import pytest

from bonecam.arrays import dots
from bonecam.planning.passes.patterns.post_ring import OUTSIDE, post_ring
from bonecam.workholding.post import Post, post_below


@pytest.mark.parametrize("radius", [1.0, 2.0])
def test_the_ball_stands_beside_the_post_all_round(pebble, mesh_of, holding, radius):
    surface = pebble()
    post = post_below(mesh_of(surface), holding)
    ring = post_ring(surface, post, radius, radius + 0.1)
    assert ring is not None
    centres = ring.contacts + radius * ring.normals
    assert post.distance(centres) == pytest.approx(radius + 0.1 + OUTSIDE, abs=1e-6)
    middles = (centres[1:] + centres[:-1]) / 2
    assert post.distance(middles).min() > radius + 0.1 - 0.01
    assert ring.contacts[0] == pytest.approx(ring.contacts[-1], abs=1e-9)
    assert np.abs(dots(ring.feeds, ring.normals)).max() < 1e-12


def test_a_post_beside_the_part_has_no_ring(pebble):
    assert post_ring(pebble(), Post(1.0, 10.0), 1.0, 1.1) is None
