"""Flutes that are held against an outer level stay out of the part, however near to it the level is."""

from collections.abc import Callable

import pytest

from bonecam.levels.measure import MachinedLevel
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.contacts import flute_slack
from bonecam.planning.scene import TANGENT_SLACK, held_level, part_chord
from bonecam.surface.tspline import TSpline

Levels = Callable[..., MachinedLevel]


@pytest.mark.parametrize("allowed", [0.004, 0.01, 0.05])
@pytest.mark.parametrize("apart", [0.0, 0.003, 0.007, 0.012, 0.05])
def test_flutes_go_into_the_part_no_deeper_than_the_gouge_tolerance_leaves_them(
    pebble: Callable[..., TSpline], level_of: Levels, allowed: float, apart: float
) -> None:
    part = MeshDistance(pebble().tessellate(part_chord(allowed)))
    held, slack = held_level(level_of(pebble(apart), 1), part, allowed)
    deepest = slack - part.signed(held.mesh.vertices).min()
    assert deepest <= flute_slack(allowed) + 2 * part_chord(allowed) < allowed + 1e-12


def test_a_level_far_from_the_part_keeps_its_coarse_mesh_and_the_part_its_own(
    pebble: Callable[..., TSpline], level_of: Levels
) -> None:
    part = MeshDistance(pebble().tessellate(0.002))
    held, slack = held_level(level_of(pebble(0.1), 1), part, 0.01)
    assert len(held.mesh.faces) < len(part.mesh.faces)
    assert slack == TANGENT_SLACK
    near, less = held_level(level_of(pebble(0.005), 1), part, 0.01)
    assert len(near.mesh.faces) > 2 * len(held.mesh.faces)
    assert less == flute_slack(0.01)
    assert held_level(level_of(pebble(), 0), part, 0.01) == (part, flute_slack(0.01))
