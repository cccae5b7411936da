"""Outlines of slices whose cells show less than the balls that ask."""

import numpy as np

from bonecam.planning.layers import FlatChart
from bonecam.planning.strategies import SPACED, STRAIGHT, offset_curves

X, Y = np.eye(3)[:2]


def test_an_outline_bends_round_a_bulge_that_is_lower_than_a_cell() -> None:
    """A wall along b with a bulge of 0.12 mm, which ends before the first line beside the wall."""
    chart = FlatChart(-Y, X, np.arange(-3.005, 4.0, 0.15), np.arange(0.0, 12.0, 0.15))

    def wall(b: np.ndarray) -> np.ndarray:
        return 0.12 * np.exp(-((b - 6.0) ** 2))

    a, b = np.meshgrid(chart.a, chart.b, indexing="ij")
    blocked = a < wall(b)
    assert (blocked == blocked[:, :1]).all(), "the cells show no bulge"
    rests = np.where(blocked, 2.0, 0.0)
    sets = offset_curves(chart, rests, 1.0, 0.8, lambda across, along: across >= wall(along))
    line = max(sets[-1], key=len)
    steps = np.linspace(0.0, 1.0, 50)[:, None, None]
    on_line = ((1 - steps) * line[:-1] + steps * line[1:]).reshape(-1, 2)
    inside = wall(on_line[:, 1]) - on_line[:, 0]
    assert inside.max() < STRAIGHT + SPACED**2 * 0.24 / 8 + 0.001
    assert np.abs(inside).max() < 2 * STRAIGHT
