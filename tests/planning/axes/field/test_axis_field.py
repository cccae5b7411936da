"""The splines of a field of axes, and the derivatives of its energy."""

import numpy as np
import pytest

from bonecam.arrays import perpendicular
from bonecam.planning.axes.field import (
    ALONG,
    AROUND,
    BOUND_WEIGHT,
    AxisBounds,
    AxisEnergy,
    AxisField,
    FieldDomain,
    basis,
    minimise,
    second_differences,
)
from bonecam.tool.elliptic_cones import EllipticCones

RANDOM = np.random.default_rng(2)
DOMAIN = FieldDomain((0.0, 1.0), (0.0, 3.0), closed=True)
OPEN = FieldDomain((0.0, 1.0), (0.0, 3.0), closed=False)
PLACES = RANDOM.random((300, 2)) * [1.0, 3.0]
ONCE_ROUND = np.array([1.0, 0.0])
VALUES = RANDOM.normal(0.8, 0.3, (2, AROUND * ALONG))


def field(winding: int = 1) -> AxisField:
    return AxisField(DOMAIN, winding, VALUES[0], VALUES[1])


def test_the_basis_sums_to_one_and_is_periodic_in_s() -> None:
    matrix = basis(PLACES, DOMAIN)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(matrix.toarray(), basis(PLACES + ONCE_ROUND, DOMAIN).toarray(), atol=1e-12)


def test_axes_are_unit_and_come_round_to_themselves() -> None:
    axes = field().axes(PLACES)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(axes, field().axes(PLACES + ONCE_ROUND), atol=1e-12)


@pytest.mark.parametrize("winding", [1, -1])
def test_the_azimuth_winds_once(winding: int) -> None:
    ring = np.column_stack([np.linspace(0, 1, 400), np.full(400, 1.2)])
    axes = AxisField(DOMAIN, winding, 0 * VALUES[0], 0 * VALUES[1] + 1.0).axes(ring)
    azimuth = np.unwrap(np.arctan2(axes[:, 1], axes[:, 0]))
    assert azimuth[-1] - azimuth[0] == pytest.approx(winding * 2 * np.pi)


def test_an_open_field_is_free_at_its_borders() -> None:
    """Its basis sums to one, and control values on a plane bend nothing; those of a closed one must come round."""
    matrix = basis(PLACES, OPEN)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=1e-12)
    slope = np.add.outer(2.0 * np.arange(ALONG), np.arange(AROUND)).ravel()
    np.testing.assert_allclose(second_differences(OPEN) @ slope, 0.0, atol=1e-9)
    assert np.abs(second_differences(DOMAIN) @ slope).max() > 1
    ends = AxisField(OPEN, 0, VALUES[0], VALUES[1]).axes(np.array([[0.0, 1.0], [1.0, 1.0]]))
    assert np.linalg.norm(ends[0] - ends[1]) > 1e-3


def energy() -> AxisEnergy:
    """Samples whose every bound is broken somewhere."""
    normals = RANDOM.normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    moves = np.delete(np.arange(299), [99, 199])
    axes = RANDOM.normal(size=(300, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    cones = EllipticCones(axes, perpendicular(axes), np.tile([0.6, 0.4], (300, 1)))
    bounds = AxisBounds(0.6, np.full(300, 1.0), 0.3, np.full(300, 0.9), cones, np.full(300, 0.1))
    places = PLACES[np.argsort(PLACES[:, 1])]
    times = RANDOM.uniform(0.01, 0.3, len(moves))
    return AxisEnergy(places, normals, DOMAIN, 1, moves, times, (8.0, 5.0), bounds)


def residuals(energy: AxisEnergy, values: np.ndarray) -> np.ndarray:
    return np.concatenate([part.values.ravel() for part in energy.residuals(values)])


def test_derivatives_of_the_energy_are_those_of_differences() -> None:
    """Of the residuals along any step J s: s G s of the normal equations G is its square, and J times r the
    gradient."""
    made = energy()
    parts = made.residuals(VALUES)
    r = residuals(made, VALUES)
    assert (r != 0).mean() > 0.4
    band = np.zeros((VALUES.size, made.bandwidth))
    for part in parts:
        part.add_to(band)
    normal = np.zeros((VALUES.size, VALUES.size))
    for d in range(made.bandwidth):
        below = np.arange(VALUES.size - d)
        normal[below + d, below] = normal[below, below + d] = band[below, d]
    gradient = sum(part.gradient for part in parts)
    for _ in range(3):
        step = RANDOM.normal(size=VALUES.shape)
        ahead, behind = (residuals(made, VALUES + sign * 1e-7 * step) for sign in (1, -1))
        change = (ahead - behind) / 2e-7
        np.testing.assert_allclose((gradient * step).sum(), change @ r, rtol=1e-4)
        np.testing.assert_allclose(step.T.ravel() @ normal @ step.T.ravel(), change @ change, rtol=1e-4)


def test_a_field_within_its_bounds_has_no_energy_of_bounds() -> None:
    normals = np.tile([0.0, 0.0, 1.0], (300, 1))
    even = np.stack([np.zeros(AROUND * ALONG), np.full(AROUND * ALONG, 0.7)])
    axes = AxisField(DOMAIN, 1, even[0], even[1]).axes(PLACES)
    none = np.zeros(0, dtype=np.int64)
    cones = EllipticCones.circular(axes, np.full(300, 0.2))
    for margin, holds in ((0.1, True), (0.3, False)):
        bounds = AxisBounds(0.1, np.full(300, 2.0), 0.2, np.full(300, 1.2), cones, np.full(300, margin))
        made = AxisEnergy(PLACES, normals, DOMAIN, 1, none, np.zeros(0), (np.inf, np.inf), bounds)
        assert (np.abs(residuals(made, even)).max() < 1e-12) == holds


@pytest.mark.parametrize(("polar", "beyond"), [(0.19, 0.01), (1.22, 0.02), (0.21, 0.0), (1.19, 0.0)])
def test_an_angle_beyond_a_bound_from_the_normal_counts_as_one_beyond_a_cone(polar: float, beyond: float) -> None:
    """Normals are upright, so angles from them are polar ones: at least 0.2, at most 1.2."""
    even = np.stack([np.zeros(AROUND * ALONG), np.full(AROUND * ALONG, polar)])
    none = np.zeros(0, dtype=np.int64)
    bounds = AxisBounds(0.1, np.full(300, 2.0), 0.2, np.full(300, 1.2), EllipticCones.none(300), np.zeros(300))
    made = AxisEnergy(
        *(PLACES, np.tile([0.0, 0.0, 1.0], (300, 1)), DOMAIN, 1, none, np.zeros(0)), *((np.inf, np.inf), bounds)
    )
    assert np.linalg.norm(residuals(made, even)) == pytest.approx(BOUND_WEIGHT * beyond, rel=0.05)


def test_one_constant_axis_has_no_energy_and_stays() -> None:
    """What is free everywhere along one axis needs no turn: a legitimate answer."""
    axis = np.array([0.48, 0.6, 0.64])
    cones = EllipticCones.circular(np.tile(axis, (300, 1)), np.full(300, 0.1))
    bounds = AxisBounds(0.1, np.full(300, 2.0), 0.0, np.full(300, 3.0), cones, np.zeros(300))
    field = AxisField.constant(OPEN, axis)
    made = AxisEnergy(
        *(PLACES, np.tile([0.0, 0.0, 1.0], (300, 1)), OPEN, 0, np.arange(299), np.full(299, 0.1)), *((8.0, 5.0), bounds)
    )
    values = np.array([field.azimuth, field.polar])
    found, least = minimise(made, values, 5)
    assert least < 1e-20
    assert np.abs(found - values).max() < 1e-9
    assert np.abs(AxisField(OPEN, 0, *found).axes(PLACES) - axis).max() < 1e-9
