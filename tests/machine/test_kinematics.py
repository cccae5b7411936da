import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bonecam.machine.kinematics import UP, forward, inverse_linear, inverse_rotary, rotate, tool_axes
from bonecam.machine.machine import machine_names, read_machine
from bonecam.nc.posting.rotary.machine_limits import tilt_limit

CHAIN_KINDS = ("table-table", "head-table", "head-head", "nutating")


@pytest.fixture(params=[*machine_names(), *CHAIN_KINDS])
def machine(write_machine, chains, request, tmp_path):
    return read_machine(
        write_machine(tmp_path, chains[request.param]) if request.param in CHAIN_KINDS else request.param
    )


def joints(seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-300, 300, (count, 3)), rng.uniform(-3.1, 3.1, (count, 2))])


def test_the_joints_that_made_a_pose_are_among_its_solutions(machine):
    known = joints(0, 3000)
    tips, axes = forward(machine, known, 70.0)
    found, free = inverse_rotary(machine, axes)
    assert not free.any()
    off = np.abs(np.angle(np.exp(1j * (found - known[:, None, 3:])))).max(2).min(1)
    # near the singular axis the angle itself is ill-conditioned, its axis is not (next test)
    assert np.median(off) < 1e-13
    assert off.max() < 1e-5
    assert np.abs(inverse_linear(machine, tips, known[:, 3:], 70.0) - known).max() < 1e-11


def test_both_solutions_lead_back_to_the_pose(machine):
    tips, axes = forward(machine, joints(1, 3000), 70.0)
    found, _ = inverse_rotary(machine, axes)
    for solution in range(2):
        again, turned = forward(machine, inverse_linear(machine, tips, found[:, solution], 70.0), 70.0)
        assert np.abs(again - tips).max() < 1e-11
        assert np.abs(turned - axes).max() < 1e-7


def test_head_axes_at_zero_leave_the_tip_where_the_linear_axes_are(machine):
    zero = joints(2, 10)
    zero[:, 3:] = 0
    tips, axes = forward(machine, zero, 123.0)
    assert np.allclose(tips, zero[:, :3] - machine.part_zero, atol=1e-12)
    assert np.allclose(axes, [0, 0, 1])


def test_the_mikron_tilts_as_its_formula_says():
    rotary = np.radians([[-30.0, 45.0], [20.0, -100.0]])
    b, c = rotary.T
    expected = np.column_stack([np.sin(b) * np.cos(c), np.sin(b) * np.sin(c), np.cos(b)])
    assert np.allclose(tool_axes(read_machine("mikron-ucp600"), rotary), expected, atol=1e-15)


def test_the_mikron_reaches_115_degrees_all_round():
    assert np.degrees(tilt_limit(read_machine("mikron-ucp600"))) == pytest.approx(115.0)


def test_an_upright_axis_leaves_the_table_free():
    machine = read_machine("mikron-ucp600")
    found, free = inverse_rotary(machine, np.array([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]]))
    assert free.tolist() == [[False, True], [False, False]]
    assert np.array_equal(found[0], np.zeros((2, 2)))


def test_an_axis_beyond_a_nutating_head_is_out_of_reach(write_machine, chains, tmp_path):
    machine = read_machine(write_machine(tmp_path, chains["nutating"]))
    found, _ = inverse_rotary(
        machine, np.array([[0.0, 0.0, -1.0], [0.0, 1.0, -0.1]]) / [[1.0], [np.hypot(1, 0.1)]]
    )
    assert np.isnan(found).all()


@settings(max_examples=50)
@given(st.floats(-10, 10), st.tuples(*[st.floats(-100, 100)] * 3), st.tuples(*[st.floats(-1, 1)] * 3))
def test_a_turn_keeps_lengths_and_is_undone_by_its_opposite(angle, vector, direction):
    axis = np.array(direction) + 3.0 * UP
    axis /= np.linalg.norm(axis)
    start, angles = np.array([vector]), np.array([angle])
    turned = rotate(start, axis, angles)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(start), abs=1e-12)
    assert np.allclose(rotate(turned, axis, -angles), start, atol=1e-12)
