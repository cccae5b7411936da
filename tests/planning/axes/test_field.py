"""The splines of a field of axes, and the derivatives of its energy.

Eq. 22 on facets as residuals of a field's control values.

Facets of contacts: closed over seam and poles, none across gaps, none on a line.
"""

import numpy as np
import pytest
from small_lump import at_parameters

from bonecam.arrays import angles_between, dots, perpendicular
from bonecam.mesh import mls_curvature, vertex_normals
from bonecam.planning.axes.field import (
    ALONG,
    AROUND,
    BOUND_WEIGHT,
    LONG,
    AxisBounds,
    AxisEnergy,
    AxisField,
    ContactFacets,
    FieldDomain,
    basis,
    contact_facets,
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


def test_the_basis_sums_to_one_and_is_periodic_in_s():
    matrix = basis(PLACES, DOMAIN)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(matrix.toarray(), basis(PLACES + ONCE_ROUND, DOMAIN).toarray(), atol=1e-12)


@pytest.mark.parametrize("winding", [1, -1])
def test_the_azimuth_winds_once(winding):
    ring = np.column_stack([np.linspace(0, 1, 400), np.full(400, 1.2)])
    axes = AxisField(DOMAIN, winding, 0 * VALUES[0], 0 * VALUES[1] + 1.0).axes(ring)
    azimuth = np.unwrap(np.arctan2(axes[:, 1], axes[:, 0]))
    assert azimuth[-1] - azimuth[0] == pytest.approx(winding * 2 * np.pi)


def test_an_open_field_is_free_at_its_borders():
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


def test_derivatives_of_the_energy_are_those_of_differences():
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


def test_a_field_within_its_bounds_has_no_energy_of_bounds():
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
def test_an_angle_beyond_a_bound_from_the_normal_counts_as_one_beyond_a_cone(polar, beyond):
    """Normals are upright, so angles from them are polar ones: at least 0.2, at most 1.2."""
    even = np.stack([np.zeros(AROUND * ALONG), np.full(AROUND * ALONG, polar)])
    none = np.zeros(0, dtype=np.int64)
    bounds = AxisBounds(0.1, np.full(300, 2.0), 0.2, np.full(300, 1.2), EllipticCones.none(300), np.zeros(300))
    made = AxisEnergy(
        *(PLACES, np.tile([0.0, 0.0, 1.0], (300, 1)), DOMAIN, 1, none, np.zeros(0)), *((np.inf, np.inf), bounds)
    )
    assert np.linalg.norm(residuals(made, even)) == pytest.approx(BOUND_WEIGHT * beyond, rel=0.05)


def test_one_constant_axis_has_no_energy_and_stays():
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


@pytest.fixture(scope="module")
def facets(lattice, capsule):
    found = contact_facets(lattice, capsule)
    assert found is not None
    return found


def edges(facets: ContactFacets) -> tuple[np.ndarray, np.ndarray]:
    faces = facets.mesh.faces
    sides = np.sort(np.vstack([faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    return np.unique(sides, axis=0, return_counts=True)


def test_facets_of_a_closed_capsule_cross_seam_and_pole(facets, lattice):
    """All contacts at a pole are one vertex. Only the ring round the lower pole, the outermost in the plane, may be
    an edge; with Euler's formula the surface is a disk then: v - e + f = 1."""
    sides, count = edges(facets)
    vertices, faces = len(facets.mesh.vertices), len(facets.mesh.faces)
    assert vertices == 30 * 39 + 2
    assert facets.found.all()
    assert len(np.unique(facets.vertex_of[np.arange(30) * 41 + 40])) == 1
    assert set(count.tolist()) <= {1, 2}
    assert vertices - len(sides) + faces in (1, 2)
    rim = np.unique(sides[count == 1])
    assert facets.mesh.vertices[rim, 2].max(initial=0.0) < 0.5


def test_no_contact_lies_in_the_circle_of_a_facet(facets):
    """On the surface: the sphere about a facet's circumcentre holds hardly any other contact."""
    a, b, c = np.swapaxes(facets.mesh.vertices[facets.mesh.faces], 0, 1)
    ab, ac, n = b - a, c - a, np.cross(b - a, c - a)
    to = np.cross(n, ab) * dots(ac, ac)[:, None] + np.cross(ac, n) * dots(ab, ab)[:, None]
    to = to / (2 * dots(n, n))[:, None]
    centre, radius = a + to, np.linalg.norm(to, axis=1)
    away = np.linalg.norm(facets.mesh.vertices[None] - centre[:, None], axis=2).min(axis=1)
    assert (away > 0.97 * radius).mean() > 0.99


def test_normals_curvature_and_areas_are_those_of_the_surface(facets, lattice, capsule):
    side = np.abs(lattice.contacts[:, 2] - 6) < 4
    off = np.degrees(angles_between(vertex_normals(facets.mesh)[facets.vertex_of], lattice.normals))
    assert np.median(off[side]) < 0.5
    assert off[side].max() < 3
    true = capsule.curvature(*lattice.parameters[side].T)
    found = mls_curvature(facets.mesh, few_allowed=True).k1[facets.vertex_of][side]
    assert np.median(np.abs(found - true.k1)) < 0.05 * np.median(true.k1)
    assert facets.areas.sum() == pytest.approx(facets.mesh.area)
    assert facets.mesh.area == pytest.approx(capsule.area, rel=0.03)


def test_no_facet_spans_a_place_without_contacts(capsule, lattice):
    kept = np.flatnonzero(np.linalg.norm(lattice.contacts - [4.0, 0.0, 6.0], axis=1) > 2.5)
    holed = contact_facets(lattice.take(kept), capsule)
    assert holed is not None
    middles = holed.mesh.vertices[holed.mesh.faces].mean(axis=1)
    assert np.linalg.norm(middles - [4.0, 0.0, 6.0], axis=1).min() > 1.8
    sides, _ = edges(holed)
    lengths = np.linalg.norm(np.diff(holed.mesh.vertices[sides], axis=1)[:, 0], axis=1)
    assert lengths.max() <= LONG * np.percentile(lengths, 99)


def test_contacts_that_follow_once_more_share_their_cell(capsule, lattice):
    twice = lattice.take(np.r_[np.arange(len(lattice.contacts)), np.full(3, 100)])
    once, again = contact_facets(lattice, capsule), contact_facets(twice, capsule)
    assert once is not None
    assert again is not None
    assert again.areas[100] == pytest.approx(once.areas[100] / 4)
    assert again.areas.sum() == pytest.approx(once.areas.sum())


def test_contacts_on_a_line_have_no_facets(capsule):
    line = np.column_stack([np.full(50, 0.25), np.linspace(0.2, 0.8, 50)])
    assert contact_facets(at_parameters(capsule, line), capsule) is None
    assert contact_facets(at_parameters(capsule, line[:2]), capsule) is None


def test_a_lone_contact_has_a_usual_area(capsule, lattice):
    near = np.flatnonzero((lattice.contacts[:, 2] > 8) & (lattice.contacts[:, 2] < 11))
    lone = int(np.argmin(np.linalg.norm(lattice.contacts - [4.0, 0.0, 3.0], axis=1)))
    path = lattice.take(np.r_[near, lone])
    found = contact_facets(path, capsule)
    assert found is not None
    assert found.found.sum() == len(near)
    assert found.areas[-1] == np.median(found.areas[:-1])
