from itertools import pairwise

import numpy as np
import pytest

from bonecam.mesh.healing.hollows.ball import CHORD
from bonecam.mesh.healing.hollows.capping import cap
from bonecam.mesh.healing.hollows.pits import SHALLOW, fill_pits
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from tests.mesh.healing.hollows.test_pits import probes_of, signed_distances, turned

RADIUS = 1.0
SIDES = 24
MOUTH = 0.4
TOP = 15.2
PORE = [(MOUTH, TOP), (0.3, 14.8), (1.0, 14.0), (1.0, 13.0)]
"""A pore in the upper end: wider inside than at its mouth."""


def pored() -> TriangleMesh:
    return turned([(3, 5), (4, 7), (4, 13), (3, 15), *PORE], SIDES)


def test_an_undercut_pore_is_closed_over_at_its_mouth_as_deep_as_the_ball_goes() -> None:
    mesh = pored()
    fill = fill_pits(mesh, RADIUS)
    assert (fill.hollows, fill.open) == (1, 0)
    assert not len(self_intersections(fill.mesh))
    near_axis = np.linalg.norm(probes_of(fill.mesh)[:, :2], axis=1) < 0.1
    deepest = TOP - (RADIUS - np.sqrt(RADIUS**2 - MOUTH**2))
    found = probes_of(fill.mesh)[near_axis & (probes_of(fill.mesh)[:, 2] > 10), 2]
    assert len(found)
    assert np.abs(found - deepest).max() < SHALLOW + CHORD


def test_a_capped_pore_takes_nothing_off_the_part_and_is_told_with_its_depth_and_volume() -> None:
    mesh = pored()
    fill = fill_pits(mesh, RADIUS)
    assert signed_distances(mesh, probes_of(fill.mesh)).min() > -1e-6
    rings = [(0.0, 14.0), *reversed(PORE)]
    area = SIDES / 2 * np.sin(2 * np.pi / SIDES)  # of a ring of radius 1
    frustums = [(z - y) * area * (q**2 + q * r + r**2) / 3 for (q, y), (r, z) in pairwise(rings)]
    assert fill.volume == pytest.approx(sum(frustums), abs=0.05)  # but for the lens that the ball reaches
    assert fill.depth > 2.0


def test_faces_that_leave_no_closed_body_are_not_capped() -> None:
    mesh = pored()
    heights = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    belt = (heights > 8) & (heights < 12)
    assert cap(mesh, belt, 0.3, lambda points: points) is None
