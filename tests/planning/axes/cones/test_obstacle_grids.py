"""Bounds of distances to a large solid, fine where the tools are."""

import numpy as np
import pytest

from bonecam.kernels.distances import distance_bounds
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.mesh.solids import solid_union
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.free_axes import distance_grids

RANDOM = np.random.default_rng(4)


@pytest.fixture(scope="module")
def plate() -> MeshDistance:
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


def test_between_balls_in_a_slot_of_a_large_plate_bounds_are_near_the_distance(plate: MeshDistance) -> None:
    centres = RANDOM.uniform([29.5, -10.0, 2.0], [30.5, 10.0, 20.0], (500, 3))
    grids = distance_grids(plate, 1.0, 40.0, centres)
    bounds, truth = distance_bounds(grids, centres), plate.unsigned(centres)
    assert (bounds <= truth).all()
    assert np.median(truth - bounds) < 0.1


def test_bounds_far_from_the_balls_hold_and_are_0_inside(plate: MeshDistance) -> None:
    centres = RANDOM.uniform([29.5, -10.0, 2.0], [30.5, 10.0, 20.0], (50, 3))
    grids = distance_grids(plate, 1.0, 90.0, centres)
    points = RANDOM.uniform([-140.0, -120.0, -60.0], [140.0, 120.0, 60.0], (20_000, 3))
    bounds, signed = distance_bounds(grids, points), plate.signed(points)
    assert (bounds <= np.maximum(signed, 0.0) + 1e-9).all()
    assert (bounds[signed > 42.0] > 0).all()


def test_what_fine_grids_hold_of_a_solid_is_inside_though_no_way_leads_into_them(plate: MeshDistance) -> None:
    deep = RANDOM.uniform([-60.0, -10.0, -10.0], [-55.0, 10.0, 10.0], (500, 3))
    assert (distance_bounds(distance_grids(plate, 1.0, 40.0, deep), deep) == 0).all()
