"""What a ball does to a ridge while it moves straight past it, known by hand."""

import numpy as np
import pytest

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.toolpath.gouge import CONTACT_SHARE, MOVE_SHARE, moves_gouge_free

TOLERANCE = 0.01


def roof(height: float = 10.0) -> MeshDistance:
    """A prism 20 mm wide whose ridge, along y at z = 0, is a right angle."""
    x, z = np.array([-height, height, 0.0]), np.array([-height, -height, 0.0])
    vertices = np.vstack([np.column_stack([x, np.full(3, y), z]) for y in (-20.0, 20.0)])
    sides = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]]
    return MeshDistance(TriangleMesh(vertices, np.array([[0, 2, 1], [3, 4, 5], *sides], dtype=np.int32)))


@pytest.mark.parametrize(
    ("deep", "free"),
    [(0.0, True), (0.9 * MOVE_SHARE, True), (MOVE_SHARE + 1.1 * CONTACT_SHARE, False), (5.0, False)],
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
