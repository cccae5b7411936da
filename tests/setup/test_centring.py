"""A part is laid into a given stock so that the farthest point of the stock is as near as can be."""

import numpy as np
from scipy.spatial import cKDTree

from bonecam.job import StockJob
from bonecam.setup.capsule import Capsule
from bonecam.setup.placement import centring_shift, may_centre

STOCK = Capsule(np.array([0.0, 0.0, 7.5]), np.array([0.0, 0.0, 29.5]), 7.5)


def test_a_part_off_the_middle_is_brought_back_and_keeps_its_margin() -> None:
    rng = np.random.default_rng(4)
    points = rng.uniform([0, -3, 4], [4, 1, 33], (3000, 3))
    moved = centring_shift(points, STOCK, 0.05)
    assert np.allclose(moved[:3, :3] @ moved[:3, :3].T, np.eye(3))
    after, surface = points @ moved[:3, :3].T + moved[:3, 3], STOCK.mesh(0.1).vertices
    before, now = (cKDTree(p).query(surface)[0].max() for p in (points, after))
    assert now < before - 0.5
    assert STOCK.signed_distance(after).max() < -0.05
    assert (centring_shift(points, STOCK, 0.05) == moved).all()


def test_only_a_given_capsule_without_a_given_place_is_free() -> None:
    assert may_centre(StockJob(diameter=15.0, length=37.0))
    assert not may_centre(StockJob())
    assert not may_centre(StockJob(diameter=15.0, length=37.0, offset_x=0.5))
