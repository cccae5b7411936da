"""A mesh laid on a stock with edges follows them."""

import numpy as np
import pytest

from bonecam.material.in_process_stock import places_on_stock
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.capsule import Capsule
from bonecam.setup.stock import Stock
from bonecam.setup.stocks.box import Box
from bonecam.setup.stocks.cylinder import Cylinder

BARS = {"cylinder": Cylinder(4.0, 10.0, 30.0), "box": Box(np.array([-5.0, -4.0, 10.0]), np.array([5.0, 4.0, 30.0]))}


def missed(bar: Stock, points: np.ndarray, faces: np.ndarray) -> float:
    """How far the bar reaches out of a mesh laid on it, mm."""
    stands = bar.mesh(0.01)
    corners = stands.vertices[stands.faces]
    shares = np.random.default_rng(0).dirichlet([1, 1, 1], (len(corners), 40))
    inside = (shares[..., None] * corners[:, None]).sum(axis=2).reshape(-1, 3)
    everywhere = np.vstack([stands.vertices, inside])
    return float(MeshDistance(TriangleMesh(points, faces)).signed(everywhere, 5.0).max())


@pytest.mark.parametrize("kind", BARS)
def test_a_mesh_laid_on_a_bar_follows_its_edges(kind: str) -> None:
    bar = BARS[kind]
    rounded = bar.round_edges(1.5).mesh(0.005)
    laid = places_on_stock(bar, rounded.vertices, rounded.faces)
    assert np.abs(bar.signed_distance(laid)).max() < 1e-9
    assert missed(bar, bar.closest_points(rounded.vertices), rounded.faces) > 0.2
    assert missed(bar, laid, rounded.faces) < 0.02


def test_on_a_stock_without_edges_places_are_the_nearest() -> None:
    capsule = Capsule(np.array([0.0, 0.0, 14.0]), np.array([0.0, 0.0, 26.0]), 4.0)
    inner = capsule.offset(-0.5).mesh(0.005)
    laid = places_on_stock(capsule, inner.vertices, inner.faces)
    assert np.array_equal(laid, capsule.closest_points(inner.vertices))
