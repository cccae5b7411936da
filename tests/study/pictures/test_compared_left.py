"""The picture of what strategies leave: what is nearest to the viewer is seen, lit by its slope."""

import numpy as np
import pytest

from bonecam.study.pictures import _seen


def test_the_place_nearest_to_the_viewer_is_seen() -> None:
    near, far, beside = [0.0, -1.0, 0.0], [0.01, 1.0, 0.01], [0.52, 2.0, 0.12]
    index, covered, _, extent = _seen(np.array([far, near, beside]), 0.1)
    assert index[0, 0] == 1
    assert index[1, 5] == 2
    assert covered.sum() == 2
    assert extent == pytest.approx((0.0, 0.6, 0.0, 0.2))


def test_a_face_towards_the_light_is_lighter_than_one_that_turns_away() -> None:
    x, z = (each.ravel() for each in np.meshgrid(np.arange(0.05, 2, 0.1), np.arange(0.05, 2, 0.1)))
    roof = np.column_stack([x, np.abs(x - 1), z])
    _, _, shades, _ = _seen(roof, 0.1)
    assert (shades[:, 12:18] > shades[:, 2:8] + 0.1).all()
