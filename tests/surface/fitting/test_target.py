"""Samples of the mesh keep their feet, and those that seem missed are looked for on the whole surface."""

from collections.abc import Callable

import numpy as np
from numpy import ndarray

from bonecam.surface.fitting import MeshSamples
from bonecam.surface.tspline import TSpline


def test_a_sample_that_followed_a_wrong_foot_is_met_where_the_surface_is(
    bone_like: Callable[..., TSpline], samples: Callable[..., tuple[ndarray, ndarray]]
) -> None:
    surface = bone_like()
    s, t = samples(400)
    points = surface.positions(s, t) + 0.01 * surface.normals(s, t)
    lost = np.array([7, 90, 210])
    start = s.copy()
    start[lost] = np.mod(s[lost] + 0.5, 1.0)
    everywhere = MeshSamples(points, np.ones(400), start, t, np.full(400, np.inf))
    alone = everywhere.on(surface, np.inf)
    assert (np.flatnonzero(alone.distances > 0.05) == lost).all()
    met = everywhere.on(surface, 0.05)
    assert met.distances.max() < 0.0101
    np.testing.assert_allclose(surface.positions(met.s, met.t), surface.positions(s, t), atol=1e-4)
    np.testing.assert_array_equal(np.delete(met.s, lost), np.delete(alone.s, lost))


def test_many_samples_that_are_missed_keep_the_feet_they_came_from(
    bone_like: Callable[..., TSpline], samples: Callable[..., tuple[ndarray, ndarray]]
) -> None:
    surface = bone_like()
    s, t = samples(100)
    points = surface.positions(s, t) + 0.2 * surface.normals(s, t)
    given = MeshSamples(points, np.ones(100), s, t, np.full(100, np.inf))
    one, other = given.on(surface, 0.05), given.on(surface, np.inf)
    np.testing.assert_array_equal(one.s, other.s)
    np.testing.assert_array_equal(one.distances, other.distances)
