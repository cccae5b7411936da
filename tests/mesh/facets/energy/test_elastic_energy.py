"""Eq. 22 on facets against its closed forms."""

import numpy as np
import pytest

from bonecam.mesh.facets import ElasticEnergy, delaunay
from bonecam.mesh.triangle_mesh import TriangleMesh

SIZE = 21
GRID = np.stack(np.meshgrid(np.arange(SIZE), np.arange(SIZE)), axis=-1).reshape(-1, 2) * 0.5
SQUARE = TriangleMesh(np.column_stack([GRID, np.zeros(len(GRID))]), delaunay(GRID))
ENERGY = ElasticEnergy.of(SQUARE)


def energy_of(energy: ElasticEnergy, values: np.ndarray, alpha: float, beta: float) -> float:
    return float((values * (energy.matrix(alpha, beta) @ values)).sum() / 2)


INSIDE = (SIZE - 2) ** 2 * 0.25
"""mm^2: cells of the vertices that are not on the boundary."""


def test_the_membrane_of_a_linear_value_is_half_its_slope_squared_times_the_area() -> None:
    tilted = (3 * GRID[:, 0] - 4 * GRID[:, 1])[:, None]
    assert energy_of(ENERGY, tilted, 1.0, 0.0) == pytest.approx(25 / 2 * 100)
    assert energy_of(ENERGY, tilted, 0.0, 1.0) == pytest.approx(0.0, abs=1e-9)


def test_the_thin_plate_of_a_parabola_is_half_its_laplacian_squared_times_the_area() -> None:
    parabola = (GRID**2).sum(axis=1)[:, None]
    assert energy_of(ENERGY, parabola, 0.0, 1.0) == pytest.approx(4**2 / 2 * INSIDE)


def test_both_weights_and_all_components_add_up() -> None:
    axes = np.random.default_rng(1).normal(size=(len(GRID), 3))
    parts = [energy_of(ENERGY, axes[:, [k]], *weights) for k in range(3) for weights in ((0.3, 0.0), (0.0, 0.7))]
    assert energy_of(ENERGY, axes, 0.3, 0.7) == pytest.approx(sum(parts))
    assert energy_of(ENERGY, axes, 0.0, 0.0) == 0


def test_a_constant_has_no_energy_and_the_energy_is_that_of_the_surface_not_of_its_place() -> None:
    assert energy_of(ENERGY, np.ones((len(GRID), 3)), 1.0, 1.0) == pytest.approx(0.0, abs=1e-9)
    turn = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]])
    turned = ElasticEnergy.of(TriangleMesh(SQUARE.vertices @ turn.T, SQUARE.faces))
    values = np.sin(GRID)
    assert energy_of(turned, values, 1.0, 0.5) == pytest.approx(energy_of(ENERGY, values, 1.0, 0.5))
