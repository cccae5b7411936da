"""Gauss rules integrate the polynomials that they promise, on spans and on elements."""

import numpy as np
import pytest

from bonecam.surface.basis import element_points, span_points, unit_rule


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6, 12])
def test_powers_up_to_twice_the_points_are_integrated_exactly(count):
    nodes, weights = unit_rule(count)
    for power in range(2 * count):
        assert nodes**power @ weights == pytest.approx(1 / (power + 1), rel=1e-13)


def test_spans_and_elements_are_integrated_one_by_one():
    t, weights = span_points(np.array([0.0, 0.25, 1.0]), 3)
    assert t**5 @ weights == pytest.approx(1 / 6, rel=1e-14)
    assert weights[:3].sum() == pytest.approx(0.25, rel=1e-14)
    boxes = np.array([[0.0, 2.0, 0.0, 1.0], [2.0, 3.0, -1.0, 1.0]])
    s, t, weights = element_points(boxes, 2)
    assert weights.reshape(2, 4).sum(axis=1) == pytest.approx([2.0, 2.0], rel=1e-14)
    assert (s**3 * t**2) @ weights == pytest.approx(4 / 3 + 65 / 4 * 2 / 3, rel=1e-13)
