"""Eq. 22 on facets as residuals of a field's control values."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bonecam.planning.axes.field import (
    ALONG,
    AROUND,
    AxisBounds,
    AxisEnergy,
    ContactFacets,
    FacetEnergy,
    FieldDomain,
    basis,
    contact_facets,
)
from bonecam.surface.tspline import TSpline
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ContactPath

VALUES = np.random.default_rng(4).normal(size=AROUND * ALONG)


@pytest.fixture(scope="module")
def case(
    revolved: Callable[..., TSpline], cylinder_contacts: Callable[[TSpline], ContactPath]
) -> tuple[FieldDomain, ContactFacets]:
    surface = revolved(lambda share, azimuth: 4.0 + 0 * azimuth + 0 * share, 0.0, 12.0)
    facets = contact_facets(cylinder_contacts(surface), surface)
    assert facets is not None
    return FieldDomain.of(surface), facets


@pytest.mark.parametrize("weights", [(1.0, 0.0), (0.0, 1.0), (0.4, 0.7)])
def test_residuals_have_the_energy_of_the_values_at_the_facets(
    case: tuple[FieldDomain, ContactFacets], weights: tuple[float, float]
) -> None:
    domain, facets = case
    made = FacetEnergy.of(facets, domain, *weights)
    at = basis(facets.path.parameters[facets.contact_of], domain) @ VALUES
    expected = at @ (facets.energy.matrix(*weights) @ at) / facets.mesh.area
    assert ((made.matrix @ VALUES) ** 2).sum() == pytest.approx(expected, rel=1e-6)


def test_an_azimuth_that_winds_turns_the_short_way_over_the_seam(case: tuple[FieldDomain, ContactFacets]) -> None:
    """Edge by edge: with its cotangent weight the square of what the azimuth turns by. The part that no control value
    changes is left out, so differences from the field that only winds are compared."""
    domain, facets = case
    made = FacetEnergy.of(facets, domain, 1.0, 0.0)
    parameters = facets.path.parameters[facets.contact_of]
    share, at = domain.round(parameters[:, 0]), basis(parameters, domain) @ VALUES
    pairs = facets.energy.stiffness.tocoo()
    turns = np.mod(share[pairs.col] - share[pairs.row] + 0.5, 1.0) - 0.5
    wound = -(pairs.data * (2 * np.pi * turns) ** 2).sum() / 2
    both = -(pairs.data * (2 * np.pi * turns + at[pairs.col] - at[pairs.row]) ** 2).sum() / 2
    radii = np.linalg.norm(facets.mesh.vertices[:, :2], axis=1)
    assert wound / facets.mesh.area == pytest.approx(np.mean(1 / radii**2), rel=0.03)
    found = ((made.matrix @ VALUES + made.wound) ** 2).sum() - (made.wound**2).sum()
    assert found == pytest.approx((both - wound) / facets.mesh.area, rel=1e-6)


def test_the_energy_on_facets_counts_beside_the_others(case: tuple[FieldDomain, ContactFacets]) -> None:
    """In rates: the feed over the axis's speed times the turn a mm."""
    domain, facets = case
    rows = facets.contact_of[:200]
    count = len(rows)
    bounds = AxisBounds(0.0, np.full(count, 9.0), 0.0, np.full(count, 9.0), EllipticCones.none(count), np.zeros(count))
    none = np.zeros(0, dtype=np.int64)
    path = facets.path
    alone = AxisEnergy(*(path.parameters[rows], path.normals[rows], domain, 0, none, np.zeros(0), (8.0, 5.0)), bounds)
    made = FacetEnergy.of(facets, domain, 1.0, 0.5)
    values = np.array([VALUES, 2 * VALUES])
    before = sum(part.energy for part in alone.residuals(values))
    after = sum(part.energy for part in replace(alone, facets=made).residuals(values))
    each = ((made.matrix @ VALUES) ** 2).sum() * path.cutter.feed**2
    assert after - before == pytest.approx(each * (1 / 8**2 + 4 / 5**2), rel=1e-6)
