"""Solids of any form on rays: their volume, hollows, overlaps, and that a mesh with a hole is found."""

import numpy as np
import pytest

from bonecam.errors import JobError
from bonecam.material.rays import lay_grid, lay_rays, lay_solids
from bonecam.mesh.solids import cylinder, revolve_ring
from bonecam.mesh.triangle_mesh import keep_faces
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.verify.sweeping import volumes

RING = revolve_ring(np.array([[3.0, 0.0], [5.0, 0.0], [5.0, 4.0], [3.0, 4.0]]), 400)


def test_a_ring_keeps_its_hole() -> None:
    sets, grid = lay_solids([RING], 0.1, 500.0)
    assert volumes(sets) == pytest.approx([RING.volume] * 3, rel=2e-3)
    assert max(int(rays.counts.max()) for rays in sets) == 2
    assert grid.cell == 0.1


def test_solids_that_overlap_count_once_and_convex_ones_are_as_bodies() -> None:
    low, high = cylinder(2.0, 0.0, 6.0, 1e-4), cylinder(2.0, 3.0, 9.0, 1e-4)
    sets, grid = lay_solids([low, high], 0.1, 500.0)
    body = Cylinder(2.0, 0.0, 9.0)
    expected = lay_rays([body], lay_grid([body], 0.1), 500.0)
    assert volumes(sets) == pytest.approx(volumes(expected), rel=1e-3)
    assert max(int(rays.counts.max()) for rays in sets) == 1
    assert np.abs(grid.rotation @ grid.rotation.T - np.eye(3)).max() < 1e-12


def test_less_memory_takes_a_coarser_cell() -> None:
    assert lay_solids([RING], 0.1, 1.0)[1].cell > 0.1


def test_a_mesh_with_a_hole_is_refused() -> None:
    with pytest.raises(JobError, match="not closed"):
        lay_solids([keep_faces(RING, slice(40, None))], 0.1, 500.0)
