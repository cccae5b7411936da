"""Paths with fewer rows."""

from itertools import pairwise

import numpy as np
from numpy import ndarray

from bonecam.report.page.contents import thinned

LENGTH = 10.0


def helix(rows: int) -> tuple[ndarray, ndarray]:
    """Tips on a helix of 5 mm, and axes that turn with it."""
    angle = np.linspace(0, 20 * np.pi, rows)
    tips = np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), angle / 6])
    axes = np.column_stack([np.cos(angle), np.sin(angle), np.ones(rows)]) / np.sqrt(2)
    return tips, axes


def farthest(points: ndarray, kept: ndarray) -> float:
    """The largest distance of a point from the segment that takes its place, mm."""
    found = 0.0
    for first, last in pairwise(kept):
        along = points[last] - points[first]
        between = points[first : last + 1] - points[first]
        share = np.clip(between @ along / (along @ along), 0, 1)
        found = max(found, np.linalg.norm(between - share[:, None] * along, axis=1).max())
    return found


def test_every_row_left_out_lies_within_the_tolerance_of_the_lines_kept() -> None:
    tips, axes = helix(20_000)
    needed = np.zeros(len(tips), dtype=bool)
    needed[[777, 12_345]] = True
    for tolerance in (0.001, 0.01, 0.1):
        kept = thinned(tips, axes, needed, tolerance, LENGTH)
        assert farthest(tips, kept) <= tolerance
        assert farthest(tips + LENGTH * axes, kept) <= tolerance
        assert {0, 777, 12_345, len(tips) - 1} <= set(kept.tolist())
        assert len(kept) < 10_000


def test_a_turn_of_the_axis_in_one_place_keeps_its_rows() -> None:
    tips = np.column_stack([np.linspace(0, 1, 100), np.zeros(100), np.zeros(100)])
    tilt = np.where(np.arange(100) == 50, 0.3, 0.0)
    axes = np.column_stack([np.zeros(100), np.sin(tilt), np.cos(tilt)])
    kept = thinned(tips, axes, np.zeros(100, dtype=bool), 0.01, LENGTH)
    assert {49, 50, 51} <= set(kept.tolist())
    assert len(kept) < 20
