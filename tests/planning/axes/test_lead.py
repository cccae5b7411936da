"""The axis runs round the singularity, not through it."""

import numpy as np
import pytest

from bonecam.arrays import angles_between, unit
from bonecam.machine.limits import polar_angles
from bonecam.planning.axes.lead import MIN_PASS_ANGLE, SINGULAR_CONE, avoid_singularity, avoid_singularity_where


def over_the_top(miss: float, count: int = 101) -> tuple[np.ndarray, np.ndarray]:
    """Axes that lean from -20 to 20 degrees past the pole at `miss` (rad), and centres an even way apart."""
    lean = np.linspace(-np.radians(20), np.radians(20), count)
    return unit(np.column_stack([np.tan(lean), np.full(count, np.tan(miss)), np.ones(count)])), np.column_stack(
        [np.linspace(0, 4, count), np.zeros((count, 2))]
    )


@pytest.mark.parametrize("miss_deg", [0.0, 1e-6, 0.04, 1.0, 2.5])
def test_a_pass_over_the_pole_turns_evenly_on_the_cone(miss_deg):
    axes, centres = over_the_top(np.radians(miss_deg))
    steered = avoid_singularity(axes, centres, np.zeros(len(axes), dtype=np.int64))
    near = polar_angles(axes) < SINGULAR_CONE
    assert np.allclose(steered[~near], axes[~near], atol=0)
    assert np.allclose(polar_angles(steered[near]), SINGULAR_CONE)
    assert angles_between(steered, axes).max() <= 2 * SINGULAR_CONE
    azimuth = np.unwrap(np.arctan2(steered[:, 1], steered[:, 0]))
    around = np.flatnonzero(near)
    turns = np.diff(azimuth[around[0] - 1 : around[-1] + 2])
    assert np.ptp(turns) < 1e-9
    assert abs(turns.sum()) <= np.pi + 1e-9


def test_passes_that_begin_end_or_stay_at_the_pole_hold_their_azimuth():
    axes, centres = over_the_top(np.radians(0.5))
    middle = len(axes) // 2
    near = polar_angles(axes) < SINGULAR_CONE
    passes = (np.arange(len(axes)) >= middle).astype(np.int64)
    steered = avoid_singularity(axes, centres, passes)
    azimuth = np.arctan2(steered[:, 1], steered[:, 0])
    first, last = np.flatnonzero(near)[[0, -1]]
    assert np.allclose(azimuth[first:middle], azimuth[first - 1])
    assert np.allclose(azimuth[middle : last + 1], azimuth[last + 1])
    whole = avoid_singularity(axes[near], centres[near], np.zeros(near.sum(), dtype=np.int64))
    assert np.allclose(polar_angles(whole), SINGULAR_CONE)
    assert np.ptp(whole, axis=0).max() < 1e-12


def test_axes_away_from_the_pole_stay():
    axes, centres = over_the_top(np.radians(3.1))
    assert (avoid_singularity(axes, centres, np.zeros(len(axes), dtype=np.int64)) == axes).all()


@pytest.mark.parametrize("lean_deg", [3.5, 6.0, 7.4])
@pytest.mark.parametrize("miss_deg", [0.0, 0.2])
def test_a_single_move_past_the_pole_is_spread_over_its_neighbours(lean_deg, miss_deg):
    lean = np.radians(np.r_[np.full(8, -lean_deg), np.full(8, lean_deg)])
    axes = unit(np.column_stack([np.tan(lean), np.full(16, np.tan(np.radians(miss_deg))), np.ones(16)]))
    centres = np.column_stack([np.linspace(0, 4, 16), np.zeros((16, 2))])
    steered = avoid_singularity(axes, centres, np.zeros(16, dtype=np.int64))
    assert np.allclose(polar_angles(steered), polar_angles(axes))
    f = np.linspace(0, 1, 101)[:, None, None]
    assert polar_angles(unit(((1 - f) * steered[:-1] + f * steered[1:]).reshape(-1, 3))).min() > MIN_PASS_ANGLE - 1e-9
    assert (steered[[0, -1]] == axes[[0, -1]]).all()


def test_a_stretch_with_one_forbidden_axis_stays_as_it_was():
    axes, centres = over_the_top(np.radians(0.5))
    twice, passes = np.vstack([axes, axes]), np.repeat([0, 1], len(axes))
    forbidden = len(axes) // 2
    steered = avoid_singularity_where(twice, np.vstack([centres, centres]), passes, lambda i, tried: i != forbidden)
    assert (steered[passes == 0] == axes).all()
    assert (steered[passes == 1] == avoid_singularity(axes, centres, passes[: len(axes)])).all()
