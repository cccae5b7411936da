"""Lines on surfaces with edges: on the edges, no wider apart than the scallop allows, contacts on the surface."""

import numpy as np
import pytest

from bonecam.planning.patterns import iso_parametric_curves
from bonecam.planning.spacing import contact_frames, line_positions, sample_lines
from bonecam.surface import skin
from bonecam.surface.tspline import TSpline

RADIUS, SCALLOP = 2.0, 0.02


def vault(closed: bool) -> TSpline:
    """A cylinder of radius 10 and length 30, closed or open over half a turn; without poles."""
    angle = np.linspace(0, 2 * np.pi if closed else np.pi, 41)[: -1 if closed else None]
    row = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle)])
    rows = [np.column_stack([row, np.full(len(row), z)]) for z in np.linspace(0, 30, 7)]
    return skin(rows, 1e-4, closed=closed)


@pytest.mark.parametrize("pattern", ["round", "along"])
@pytest.mark.parametrize("closed", [False, True])
def test_lines_reach_every_edge_and_stop_before_a_seam(closed: bool, pattern: str) -> None:
    surface = vault(closed)
    lines = line_positions(surface, pattern, RADIUS, SCALLOP)
    low, high = surface.domain[1 if pattern == "round" else 0]
    assert (np.diff(lines) > 0).all()
    assert lines[0] == low
    assert (lines[-1] == high) == (pattern == "round" or not closed)


@pytest.mark.parametrize("pattern", ["round", "along"])
def test_lines_are_as_far_apart_as_the_scallop_allows(pattern: str) -> None:
    surface = vault(closed=False)
    lines = line_positions(surface, pattern, RADIUS, SCALLOP)
    kappa = 0.0 if pattern == "round" else 0.1
    flat = 2 * np.sqrt(SCALLOP * (2 * RADIUS - SCALLOP))
    exact = flat / np.sqrt((1 + kappa * RADIUS) * (1 + kappa * SCALLOP))
    length = 30.0 if pattern == "round" else 10 * np.pi
    assert len(lines) == pytest.approx(1 + length / exact, abs=2)
    assert len(lines) >= 1 + length / exact


@pytest.mark.parametrize("pattern", ["round", "along"])
def test_contacts_of_an_open_surface_lie_on_it_with_chords_within_tolerance(pattern: str) -> None:
    surface = vault(closed=False)
    curves = iso_parametric_curves(surface, pattern, np.array([0.0, 0.4, 1.0]), RADIUS, SCALLOP)
    lines = sample_lines(surface, curves, RADIUS, 0.002, 5.0)
    points, normals, feeds = contact_frames(surface, *curves.at(lines.line, lines.x))
    assert np.abs(np.hypot(points[:, 0], points[:, 1]) - 10).max() < 1e-3
    assert np.abs((normals * feeds).sum(1)).max() < 1e-12
    same = lines.line[1:] == lines.line[:-1]
    centres = points + RADIUS * normals
    middles = ((centres[1:] + centres[:-1]) / 2)[same]
    assert np.abs(np.hypot(middles[:, 0], middles[:, 1]) - 12).max() < 0.003
    across = (1.0, 0.4, 0.0) if pattern == "round" else (0.0, 0.4, 1.0)
    for number, fixed in enumerate(across):
        own = lines.parameters[lines.line == number]
        assert (own[:, 1 if pattern == "round" else 0] == fixed).all()
        assert own[0, 0 if pattern == "round" else 1] == 0
        assert own[-1, 0 if pattern == "round" else 1] == 1
