"""The distance of a cone from an upright cylinder against the nearest of many points."""

import numpy as np
import pytest

from bonecam.kernels.bodies import column_distance, frustum_distance

POINTS = 400


def sampled_distance(foot, axis, section, column):
    """The least distance of points on the cylinder from the cone: a little too large."""
    radius, top, bottom = column
    angle = np.linspace(0, 2 * np.pi, POINTS, endpoint=False)
    wall = [(radius, z) for z in np.linspace(bottom, top, POINTS // 4)]
    lids = [(r, z) for r in np.linspace(0, radius, POINTS // 10) for z in (bottom, top)]
    points = np.vstack(
        [np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(POINTS, z)]) for r, z in wall + lids]
    )
    along = (points - foot) @ axis
    out = np.linalg.norm(points - foot - along[:, None] * axis, axis=1)
    taper = (section[3] - section[2]) / (section[1] - section[0])
    return min(frustum_distance(a, o, section[0], section[1], section[2], taper) for a, o in zip(along, out))


@pytest.mark.parametrize("seed", range(12))
def test_a_cone_is_as_far_from_a_cylinder_as_the_nearest_point(seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3) * ([0.05, 0.05, 1.0] if seed % 3 == 0 else 1.0)
    axis /= np.linalg.norm(axis)
    foot = rng.normal(size=3) * 30 + [0.0, 0.0, 60.0]
    section = np.array([10.0, 60.0, *rng.uniform(2, 40, 2)])
    column = np.array([rng.uniform(2, 30), rng.uniform(5, 50), 0.0])
    truth = sampled_distance(foot, axis, section, column)
    told = column_distance(foot, axis, section, column, np.inf)
    assert told == pytest.approx(max(truth, 0.0), abs=0.05)
    assert column_distance(foot, axis, section, column, 1.0) == pytest.approx(min(told, 1.0))


def test_bodies_that_meet_have_no_distance():
    foot, axis = np.array([0.0, 3.0, 10.0]), np.array([0.0, 0.0, 1.0])
    assert column_distance(foot, axis, np.array([0.0, 5.0, 2.0, 2.0]), np.array([2.0, 12.0, 0.0]), 9.0) == 0
