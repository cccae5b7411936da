"""Bounds of distances to a large solid, fine where the tools are.

What is known of the room round contacts before any tool is marched.

The triangles of the sphere: each lies in its cone, in the one it was divided from, and all cover the sphere once.
"""

import numpy as np
import pytest

from bonecam.kernels.distances import distance_bounds
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.mesh.solids import solid_union
from bonecam.planning.axes.free_axes import ROOMS, distance_grids, leaf_centres, rooms_at, sphere_leaves
from bonecam.planning.scene import TANGENT_SLACK

RANDOM = np.random.default_rng(4)


@pytest.fixture(scope="module")
def plate():
    """A plate of 200 x 160 x 40 mm with a slot 4 mm wide and 20 mm deep across its top."""
    blocks = [
        box(np.array(low), np.array(high))
        for low, high in (
            ([-100.0, -80.0, -20.0], [100.0, 80.0, 0.0]),
            ([-100.0, -80.0, -1.0], [28.0, 80.0, 20.0]),
            ([32.0, -80.0, -1.0], [100.0, 80.0, 20.0]),
        )
    ]
    return MeshDistance(solid_union(blocks))


def box(low: np.ndarray, high: np.ndarray) -> TriangleMesh:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    return convex_hull(low + corners * (high - low))


def test_between_balls_in_a_slot_of_a_large_plate_bounds_are_near_the_distance(plate):
    centres = RANDOM.uniform([29.5, -10.0, 2.0], [30.5, 10.0, 20.0], (500, 3))
    grids = distance_grids(plate, 1.0, 40.0, centres)
    bounds, truth = distance_bounds(grids, centres), plate.unsigned(centres)
    assert (bounds <= truth).all()
    assert np.median(truth - bounds) < 0.1


def test_bounds_far_from_the_balls_hold_and_are_0_inside(plate):
    centres = RANDOM.uniform([29.5, -10.0, 2.0], [30.5, 10.0, 20.0], (50, 3))
    grids = distance_grids(plate, 1.0, 90.0, centres)
    points = RANDOM.uniform([-140.0, -120.0, -60.0], [140.0, 120.0, 60.0], (20_000, 3))
    bounds, signed = distance_bounds(grids, points), plate.signed(points)
    assert (bounds <= np.maximum(signed, 0.0) + 1e-9).all()
    assert (bounds[signed > 42.0] > 0).all()


def test_what_fine_grids_hold_of_a_solid_is_inside_though_no_way_leads_into_them(plate):
    deep = RANDOM.uniform([-60.0, -10.0, -10.0], [-55.0, 10.0, 10.0], (500, 3))
    assert (distance_bounds(distance_grids(plate, 1.0, 40.0, deep), deep) == 0).all()


def test_the_largest_empty_ball_at_a_contact_is_that_of_trying_all(made):
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


def corners() -> np.ndarray:
    leaves = sphere_leaves()[1]
    return leaves.vertices[leaves.leaves]


def test_triangles_lie_in_the_cones_of_all_that_they_were_divided_from():
    triangles, _ = sphere_leaves()
    counts = np.diff(triangles.starts)
    assert counts.tolist() == [320, 1280, 5120]
    for level, start in enumerate(triangles.starts[:-1]):
        holder = start + np.arange(5120) // 4 ** (2 - level)
        cosine = np.einsum("nci,ni->nc", corners(), triangles.centres[holder])
        if level == 2:
            assert (cosine >= np.cos(triangles.caps[holder])[:, None]).all()
        assert np.degrees(np.arccos(cosine.min())) < [11.0, 5.6, 2.75][level]


def test_leaves_cover_the_sphere_once():
    a, b, c = corners().transpose(1, 0, 2)
    volume = np.linalg.det(corners())
    assert volume.min() > 0
    angle = 2 * np.arctan2(volume, 1 + (a * b).sum(1) + (b * c).sum(1) + (c * a).sum(1))
    assert angle.sum() == pytest.approx(4 * np.pi)
    leaves = sphere_leaves()[1]
    for ends, beside in zip(leaves.edges, leaves.beside):
        assert set(ends) == set(leaves.leaves[beside[0]]) & set(leaves.leaves[beside[1]])
    assert np.einsum("nci,ni->nc", corners(), leaf_centres()).min() > 0.998
