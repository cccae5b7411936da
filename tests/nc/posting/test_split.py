from collections.abc import Callable

import numpy as np
import pytest

from bonecam.machine.control import Control
from bonecam.machine.machine import read_machine
from bonecam.nc.path_words import POLE_PASS, between, split_moves
from bonecam.tool.path import ToolPath

TOLERANCE, HOLD = 0.002, np.radians(0.0005)
CONTROLS = {
    "tool-centre": Control(read_machine("mikron-ucp600"), True, 1.0, 75.0),
    "joints": Control(read_machine("linuxcnc-xyzbc"), False, 1.0, 75.0),
}


@pytest.fixture(params=CONTROLS.values(), ids=CONTROLS)
def control(request):
    return request.param


def rough_path(capsule_path):
    """Big steps in position and axis: every move needs splitting."""
    return capsule_path(turns=4.0, count=60)


def past_the_pole(path_of: Callable[..., ToolPath], miss_deg: float) -> ToolPath:
    """Axes that lean from -10 to 10 degrees past the singular axis."""
    angle = np.radians(np.linspace(-10, 10, 12))
    axes = np.column_stack([np.sin(angle), np.full(12, np.radians(miss_deg)), np.cos(angle)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return path_of(np.column_stack([np.linspace(0, 6, 12), np.zeros(12), np.full(12, 60.0)]), axes)


def deviations(control, moves) -> tuple[np.ndarray, np.ndarray]:
    """Distance of tip and ball centre from the way meant, at 31 places of every move."""
    words = control.words(moves.tips, moves.angles)
    move = np.arange(len(words) - 1)
    worst = []
    for fraction in np.linspace(0, 1, 31):
        tip, axis = control.between(words[:-1], words[1:], fraction)
        meant, turned = between(moves.tips, moves.axes, control.radius, move, np.full(len(move), fraction))
        centre = np.linalg.norm(tip + control.radius * axis - meant - control.radius * turned, axis=1)
        worst.append(np.maximum(centre, np.linalg.norm(tip - meant, axis=1)))
    return np.max(worst, axis=0), moves.kinds[1:] == 2


def test_between_any_two_rows_the_control_stays_within_the_tolerance(capsule_path, control):
    moves = split_moves(rough_path(capsule_path), control, TOLERANCE, HOLD)
    worst, rapid = deviations(control, moves)
    assert worst[~rapid].max() <= 1.1 * TOLERANCE
    assert worst[rapid].max() <= 20 * TOLERANCE
    assert len(moves.tips) > len(rough_path(capsule_path).tips)


def test_the_rows_of_the_path_stay_and_keep_their_order(capsule_path, control):
    path = rough_path(capsule_path)
    moves = split_moves(path, control, TOLERANCE, HOLD)
    last = np.r_[np.flatnonzero(np.diff(moves.rows)), len(moves.rows) - 1]
    assert np.array_equal(moves.rows[last], np.arange(len(path.tips)))
    assert np.array_equal(moves.tips[last], path.tips)
    assert np.array_equal(moves.axes[last], path.axes)
    assert np.array_equal(moves.kinds, path.kinds[moves.rows])


def test_without_tool_centre_control_no_feed_move_is_longer_than_a_millimetre(capsule_path):
    moves = split_moves(rough_path(capsule_path), CONTROLS["joints"], TOLERANCE, HOLD)
    steps = np.linalg.norm(np.diff(moves.tips, axis=0), axis=1)
    assert steps[moves.kinds[1:] != 2].max() <= 1 + 1e-9


def test_a_path_fine_enough_is_left_alone(capsule_path):
    path = capsule_path(count=900)
    assert len(split_moves(path, CONTROLS["tool-centre"], TOLERANCE, HOLD).tips) == len(path.tips)


@pytest.mark.parametrize("miss_deg", [0.0, 0.001, 0.05, 1.0])
def test_a_cut_past_the_singular_axis_is_split_until_it_holds(path_of, control, miss_deg):
    moves = split_moves(past_the_pole(path_of, miss_deg), control, TOLERANCE, HOLD)
    worst, rapid = deviations(control, moves)
    assert worst[~rapid].max() <= 1.2 * TOLERANCE
    assert len(moves.tips) < 3000


@pytest.mark.parametrize("miss_deg", [0.0, 0.001, 0.05, 1.0])
def test_no_feed_move_turns_an_axis_by_more_than_ten_degrees_but_at_the_pole(path_of, control, miss_deg):
    moves = split_moves(past_the_pole(path_of, miss_deg), control, TOLERANCE, HOLD)
    feed = moves.kinds[1:] != 2
    turn = np.degrees(np.abs(np.diff(moves.angles, axis=0)).max(axis=1))
    at_pole = np.linalg.norm(np.diff(moves.axes, axis=0), axis=1) < POLE_PASS
    assert turn[feed & ~at_pole].max() <= 10 + 1e-6
    assert turn[feed].max() <= 90 + 1e-6
