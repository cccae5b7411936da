"""What a ball does to a ridge while it moves straight past it, known by hand."""

import numpy as np
import pytest

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.contacts import (
    BETWEEN_SHARE,
    FLUTE_SHARE,
    MESH_SHARE,
    MOVE_SHARE,
    POSTING_SHARE,
    WORD_ROUNDING,
    gouge_free_lifts,
    moves_gouge_free,
    planned_tolerance,
)

TOLERANCE = 0.01


def roof(height: float = 10.0) -> MeshDistance:
    """A prism 20 mm wide whose ridge, along y at z = 0, is a right angle."""
    x, z = np.array([-height, height, 0.0]), np.array([-height, -height, 0.0])
    vertices = np.vstack([np.column_stack([x, np.full(3, y), z]) for y in (-20.0, 20.0)])
    sides = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]]
    return MeshDistance(TriangleMesh(vertices, np.array([[0, 2, 1], [3, 4, 5], *sides], dtype=np.int32)))


@pytest.mark.parametrize(
    ("deep", "free"), [(0.0, True), (0.9 * MOVE_SHARE, True), (1.05 * BETWEEN_SHARE, False), (5.0, False)]
)
@pytest.mark.parametrize("length", [0.1, 4.0])
def test_a_ball_that_passes_over_a_ridge_may_not_enter_it(deep: float, free: bool, length: float) -> None:
    """Both its ends may be clear of the ridge; the middle is `deep` tolerances in it."""
    z = 1.0 - deep * TOLERANCE
    starts, ends = np.array([[-0.4 * length, 0.0, z]]), np.array([[0.6 * length, 0.3, z]])
    assert moves_gouge_free(starts, ends, 1.0, TOLERANCE, roof()).tolist() == [free]


def test_each_move_is_judged_for_itself() -> None:
    starts = np.array([[0.0, 0.0, 1.0], [-3.0, 0.0, 1.0], [0.0, 0.0, 3.0]])
    ends = np.array([[3.0, 0.0, 1.0], [3.0, 0.0, 0.5], [0.0, 0.0, 1.0]])
    assert moves_gouge_free(starts, ends, 1.0, TOLERANCE, roof()).tolist() == [True, False, True]


def test_a_way_that_leads_into_the_part_is_no_way_out() -> None:
    starts, ends = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -6.0]])
    assert not moves_gouge_free(starts, ends, 1.0, TOLERANCE, roof()).any()


def bump(place: float) -> MeshDistance:
    """A block with a flat top at z = 0 and a blunt ridge across it, 0.05 mm high, at x = `place`."""
    x = np.array([-20.0, place - 0.05, place, place + 0.05, 20.0, 20.0, -20.0])
    z = np.array([0.0, 0.0, 0.05, 0.0, 0.0, -10.0, -10.0])
    vertices = np.vstack([np.column_stack([x, np.full(7, y), z]) for y in (-20.0, 20.0)])
    around = [[a, b, c] for i in range(7) for j in [(i + 1) % 7] for a, b, c in ((i, j, j + 7), (i, j + 7, i + 7))]
    cap = [(0, 1, 6), (1, 3, 6), (1, 2, 3), (3, 5, 6), (3, 4, 5)]
    ends = [(c, b, a) for a, b, c in cap] + [(a + 7, b + 7, c + 7) for a, b, c in cap]
    faces = np.array(around + ends, dtype=np.int32)
    mesh = TriangleMesh(vertices, faces)
    return MeshDistance(mesh if mesh.volume > 0 else TriangleMesh(vertices, faces[:, ::-1]))


@pytest.mark.parametrize("place", [0.5, 1.0, 1.25, 2.0, 2.4, 3.9])
def test_a_long_move_is_lifted_over_a_ridge_wherever_it_lies(place: float) -> None:
    contacts, up = np.array([[-5.0, 0.0, 0.0], [5.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
    obstacle = bump(place)
    lifts = gouge_free_lifts(contacts, up, 0.5, TOLERANCE, [obstacle], np.array([True, False]), 0.2)
    centres = contacts + (0.5 + lifts)[:, None] * up
    way = np.linspace(centres[0], centres[1], 2001)
    assert (0.5 - obstacle.signed(way)).max() <= TOLERANCE * BETWEEN_SHARE


def test_what_balls_mesh_and_control_use_up_is_the_tolerance() -> None:
    assert BETWEEN_SHARE + MESH_SHARE + POSTING_SHARE <= 1.0


def test_a_smaller_tolerance_leaves_room_for_the_rounding_of_words() -> None:
    assert planned_tolerance(0.01) == 0.01
    for allowed in (0.002, 0.005, 0.00999):
        planned = planned_tolerance(allowed)
        used = (max(BETWEEN_SHARE, FLUTE_SHARE) + MESH_SHARE + POSTING_SHARE) * planned
        assert 0 < planned <= 0.01
        assert used + WORD_ROUNDING <= allowed * (1 + 1e-9)
