"""Blunt edges of blades are rounded outward by half of their width; one side of a blade stays open."""

import numpy as np
import pytest

from bonecam.surface.blades import BLUNT, has_blunt_edge, rounded_edge, widest_edge
from bonecam.surface.skinning import PointRows

LENGTH, WIDTH = 20.0, 0.3


def rows(width: float) -> PointRows:
    """Sections from the blunt edge at x = LENGTH along one side, round the other edge and back, counter-clockwise."""
    u = np.linspace(-1.0, 1.0, 81)
    side = (width / 2 + (1 - u**2) * 1.5) * np.sign(u)
    section = np.column_stack([LENGTH * u**2, np.where(u == 0, 0.0, -side)])
    return PointRows(tuple(np.column_stack([section, np.full(len(u), z)]) for z in (0.0, 3.0, 6.0)), None, closed=False)


def test_the_cap_is_a_half_circle_over_the_edge() -> None:
    given = rows(WIDTH)
    assert widest_edge(given) == pytest.approx(WIDTH)
    made = rounded_edge(given)
    assert made.closed
    for before, after in zip(given.rows, made.rows):
        np.testing.assert_array_equal(after[: len(before)], before)
        cap = after[len(before) :]
        middle = (before[0] + before[-1]) / 2
        np.testing.assert_allclose(np.linalg.norm(cap - middle, axis=1), WIDTH / 2)
        assert (cap[:, 0] > LENGTH).all()
        assert cap[:, 0].max() == pytest.approx(LENGTH + WIDTH / 2)
        np.testing.assert_allclose(cap[:, 2], before[0, 2])


def test_its_skin_is_closed_round() -> None:
    made = rounded_edge(rows(WIDTH)).skin(0.01)
    assert made.closed_in_s
    assert not any(made.poles)


def test_one_side_and_closed_rows_stay_as_they_are() -> None:
    side = rows(3 * BLUNT * 2 * LENGTH)
    assert rounded_edge(side) is side
    closed = rounded_edge(rows(WIDTH))
    assert rounded_edge(closed) is closed
    assert widest_edge(closed) == 0.0


def test_a_surface_up_to_a_blunt_edge_is_told_from_one_side_and_from_a_closed_one() -> None:
    assert has_blunt_edge(rows(WIDTH).skin(0.01))
    assert not has_blunt_edge(rows(3 * BLUNT * 2 * LENGTH).skin(0.01))
    assert not has_blunt_edge(rounded_edge(rows(WIDTH)).skin(0.01))
