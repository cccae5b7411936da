"""Facets of contacts: closed over seam and poles, none across gaps, none on a line."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.arrays import angles_between, dots
from bonecam.planning.axes.field import LONG, ContactFacets, contact_facets
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ContactPath


@pytest.fixture(scope="module")
def facets(lattice: ContactPath, capsule: TSpline) -> ContactFacets:
    found = contact_facets(lattice, capsule)
    assert found is not None
    return found


def edges(facets: ContactFacets) -> tuple[np.ndarray, np.ndarray]:
    faces = facets.mesh.faces
    sides = np.sort(np.vstack([faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    return np.unique(sides, axis=0, return_counts=True)


def test_facets_of_a_closed_capsule_cross_seam_and_pole(facets: ContactFacets, lattice: ContactPath) -> None:
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


def test_no_contact_lies_in_the_circle_of_a_facet(facets: ContactFacets) -> None:
    """On the surface: the sphere about a facet's circumcentre holds hardly any other contact."""
    a, b, c = np.swapaxes(facets.mesh.vertices[facets.mesh.faces], 0, 1)
    ab, ac, n = b - a, c - a, np.cross(b - a, c - a)
    to = np.cross(n, ab) * dots(ac, ac)[:, None] + np.cross(ac, n) * dots(ab, ab)[:, None]
    to = to / (2 * dots(n, n))[:, None]
    centre, radius = a + to, np.linalg.norm(to, axis=1)
    away = np.linalg.norm(facets.mesh.vertices[None] - centre[:, None], axis=2).min(axis=1)
    assert (away > 0.97 * radius).mean() > 0.99


def test_normals_curvature_and_areas_are_those_of_the_surface(
    facets: ContactFacets, lattice: ContactPath, capsule: TSpline
) -> None:
    side = np.abs(lattice.contacts[:, 2] - 6) < 4
    off = np.degrees(angles_between(facets.vertex_normals[facets.vertex_of], lattice.normals))
    assert np.median(off[side]) < 0.5
    assert off[side].max() < 3
    true = capsule.curvature(*lattice.parameters[side].T)
    found = facets.curvature.k1[facets.vertex_of][side]
    assert np.median(np.abs(found - true.k1)) < 0.05 * np.median(true.k1)
    assert facets.areas.sum() == pytest.approx(facets.mesh.area)
    assert facets.mesh.area == pytest.approx(capsule.area, rel=0.03)


def test_no_facet_spans_a_place_without_contacts(capsule: TSpline, lattice: ContactPath) -> None:
    kept = np.flatnonzero(np.linalg.norm(lattice.contacts - [4.0, 0.0, 6.0], axis=1) > 2.5)
    holed = contact_facets(lattice.take(kept), capsule)
    assert holed is not None
    middles = holed.mesh.vertices[holed.mesh.faces].mean(axis=1)
    assert np.linalg.norm(middles - [4.0, 0.0, 6.0], axis=1).min() > 1.8
    sides, _ = edges(holed)
    lengths = np.linalg.norm(np.diff(holed.mesh.vertices[sides], axis=1)[:, 0], axis=1)
    assert lengths.max() <= LONG * np.percentile(lengths, 99)


def test_contacts_that_follow_once_more_share_their_cell(capsule: TSpline, lattice: ContactPath) -> None:
    twice = lattice.take(np.r_[np.arange(len(lattice.contacts)), np.full(3, 100)])
    once, again = contact_facets(lattice, capsule), contact_facets(twice, capsule)
    assert once is not None
    assert again is not None
    assert again.areas[100] == pytest.approx(once.areas[100] / 4)
    assert again.areas.sum() == pytest.approx(once.areas.sum())


def test_contacts_on_a_line_have_no_facets(capsule: TSpline, at_parameters: Callable[..., ContactPath]) -> None:
    line = np.column_stack([np.full(50, 0.25), np.linspace(0.2, 0.8, 50)])
    assert contact_facets(at_parameters(capsule, line), capsule) is None
    assert contact_facets(at_parameters(capsule, line[:2]), capsule) is None


def test_a_lone_contact_has_a_usual_area(capsule: TSpline, lattice: ContactPath) -> None:
    near = np.flatnonzero((lattice.contacts[:, 2] > 8) & (lattice.contacts[:, 2] < 11))
    lone = int(np.argmin(np.linalg.norm(lattice.contacts - [4.0, 0.0, 3.0], axis=1)))
    path = lattice.take(np.r_[near, lone])
    found = contact_facets(path, capsule)
    assert found is not None
    assert found.found.sum() == len(near)
    assert found.areas[-1] == np.median(found.areas[:-1])
