"""What carries a surface that is machined alone, and how thick its post is."""

import numpy as np

from bonecam.job import HoldingJob
from bonecam.mesh.solids import cylinder
from bonecam.mesh.triangle_mesh import side_by_side
from bonecam.planning.post_length import carrying_solid, surface_holding
from bonecam.surface import skin

ANGLE = np.linspace(0, 2 * np.pi, 24, endpoint=False)
TUBE = skin([np.column_stack([3 * np.cos(ANGLE), 3 * np.sin(ANGLE), np.full(24, z)]) for z in (0.0, 4.0, 8.0)], 0.01)
ROD = cylinder(3.05, 0.0, 8.0, 0.01)
CASING = cylinder(9.0, 12.0, 14.0, 0.05)


def test_a_casing_beside_it_carries_no_surface() -> None:
    carrying = carrying_solid(TUBE, side_by_side([CASING, ROD]))
    assert np.abs(carrying.bounds - ROD.bounds).max() < 1e-9


def test_a_post_is_as_thick_as_the_underside_and_stands_in_a_collet_where_nothing_is_named() -> None:
    found = surface_holding(HoldingJob(), TUBE, ROD)
    assert (found.diameter, found.chuck_diameter, found.chuck_height) == (6.0, 22.0, 100.0)
    named = surface_holding(HoldingJob(length=60.0), TUBE, ROD)
    assert (named.diameter, named.length, named.chuck_height) == (6.0, 60.0, 0.0)
    assert surface_holding(HoldingJob(diameter=2.0, length=60.0), TUBE, ROD).diameter == 2.0
