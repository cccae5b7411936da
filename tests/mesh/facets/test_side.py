"""Above and below facets, near them and far out."""

import numpy as np

from bonecam.mesh.facets import delaunay
from bonecam.mesh.smooth_surface import heights_above
from bonecam.mesh.triangle_mesh import TriangleMesh

PLACES = np.random.default_rng(5).random((80, 2)) * 10
BOWL = TriangleMesh(np.column_stack([PLACES, ((PLACES - 5) ** 2).sum(axis=1) / 10]), delaunay(PLACES))


def test_heights_over_a_plane_are_exact() -> None:
    plane = TriangleMesh(np.column_stack([PLACES, np.zeros(80)]), delaunay(PLACES))
    points = np.array([[5.0, 5.0, 2.0], [4.0, 6.0, -1.5], [5.0, 5.0, 0.0]])
    np.testing.assert_allclose(heights_above(points, plane), [2.0, -1.5, 0.0], atol=1e-12)


def test_locations_along_the_normal_are_above_and_against_it_below() -> None:
    up = np.array([0.0, 0.0, 1.0])
    assert (heights_above(BOWL.vertices + 0.5 * up, BOWL) > 0).all()
    assert (heights_above(BOWL.vertices - 0.5 * up, BOWL) < 0).all()


def test_a_location_that_dives_under_a_neighbour_is_not_above() -> None:
    """On its contact's outer side, yet below the rising side of the bowl."""
    lowest = int(np.argmin(BOWL.vertices[:, 2]))
    location = BOWL.vertices.copy()
    location[lowest] += [3.0, 0.0, 0.3]
    assert heights_above(location, BOWL)[lowest] < 0
