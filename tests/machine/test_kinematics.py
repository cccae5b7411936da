"""The kinematics against LinuxCNC's own modules, loaded without realtime."""

import importlib.util
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machine_files import CHAINS, machine_text, write_machine

from bonecam.machine import forward, inverse_rotary, machine_names, read_machine
from bonecam.machine.kinematics import UP, inverse_linear, link_poses, rotate, tool_axes
from bonecam.machine.limits import tilt_band

CHAIN_KINDS = ("table-table", "head-table", "head-head", "nutating")


@pytest.fixture(params=[*machine_names(), *CHAIN_KINDS])
def machine(request, tmp_path):
    return read_machine(
        write_machine(tmp_path, CHAINS[request.param]) if request.param in CHAIN_KINDS else request.param
    )


def joints(seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-300, 300, (count, 3)), rng.uniform(-3.1, 3.1, (count, 2))])


def of(machine, known: np.ndarray) -> np.ndarray:
    """The joints with the axes that are locked at their angles."""
    low, high = np.array([axis.limits for axis in machine.rotary]).T
    known[:, 3:] = np.where(low == high, low, known[:, 3:])
    return known


def test_the_joints_that_made_a_pose_are_among_its_solutions(machine):
    known = of(machine, joints(0, 3000))
    tips, axes = forward(machine, known, 70.0)
    found, free = inverse_rotary(machine, axes)
    assert not free.any()
    off = np.nanmin(np.abs(np.angle(np.exp(1j * (found - known[:, None, 3:])))).max(2), axis=1)
    # near the singular axis the angle itself is ill-conditioned, its axis is not (next test)
    assert np.median(off) < 1e-13
    assert off.max() < 1e-5
    assert np.abs(inverse_linear(machine, tips, known[:, 3:], 70.0) - known).max() < 1e-11


def test_both_solutions_lead_back_to_the_pose(machine):
    tips, axes = forward(machine, of(machine, joints(1, 3000)), 70.0)
    found, _ = inverse_rotary(machine, axes)
    for solution in range(1 if any(axis.locked for axis in machine.rotary) else 2):
        again, turned = forward(machine, inverse_linear(machine, tips, found[:, solution], 70.0), 70.0)
        assert np.abs(again - tips).max() < 1e-11
        assert np.abs(turned - axes).max() < 1e-7


def test_head_axes_at_zero_leave_the_tip_where_the_linear_axes_are(machine):
    zero = joints(2, 10)
    zero[:, 3:] = 0
    tips, axes = forward(machine, zero, 123.0)
    assert np.allclose(machine.in_machine(tips), zero[:, :3] - machine.part_zero, atol=1e-12)
    assert np.allclose(machine.in_machine(axes), [0, 0, 1])


def test_a_bar_along_x_is_cut_across_it():
    machine = read_machine("mill-4axis")
    assert machine.letters == "XYZA"
    assert np.degrees(tilt_band(machine)) == pytest.approx([90.0, 90.0])
    turned = np.array([[0.0, 0.0, 0.0, np.radians(30.0), 0.0]])
    # a part point 80 mm out on the bar and 3 mm towards the tool at A 0, met by a tool that stands upright
    tip = np.array([[3.0, 0.0, 80.0]])
    joints_ = inverse_linear(machine, tip, turned[:, 3:], 100.0)
    assert joints_[0, :3] == pytest.approx([80.0, 1.5, 3.0 * np.cos(np.radians(30.0))])
    assert forward(machine, joints_, 100.0)[0] == pytest.approx(tip)


def test_a_locked_axis_leaves_the_nearest_tool_axis_of_the_other(tmp_path):
    text = CHAINS["table-table"].replace("limits_deg = [-179.0, 179.0]", "locked_deg = -40.0", 1)
    machine = read_machine(write_machine(tmp_path, text))
    assert np.degrees(tilt_band(machine)) == pytest.approx([40.0, 40.0])
    tilt, azimuth = np.radians([40.5, 40.0, 45.0]), 1.1
    axes = np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    found, _ = inverse_rotary(machine, axes)
    assert np.isnan(found[:, 1]).all()
    assert np.isnan(found[2]).all()
    assert np.allclose(tool_axes(machine, found[:2, 0]), axes[1], atol=1e-12)


def test_the_mikron_tilts_as_its_formula_says():
    rotary = np.radians([[-30.0, 45.0], [20.0, -100.0]])
    b, c = rotary.T
    expected = np.column_stack([np.sin(b) * np.cos(c), np.sin(b) * np.sin(c), np.cos(b)])
    assert np.allclose(tool_axes(read_machine("mikron-ucp600"), rotary), expected, atol=1e-15)


def test_the_mikron_reaches_115_degrees_all_round():
    assert np.degrees(tilt_band(read_machine("mikron-ucp600"))) == pytest.approx([0.0, 115.0])


def test_an_upright_axis_leaves_the_table_free():
    machine = read_machine("mikron-ucp600")
    found, free = inverse_rotary(machine, np.array([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]]))
    assert free.tolist() == [[False, True], [False, False]]
    assert np.array_equal(found[0], np.zeros((2, 2)))


def test_an_axis_beyond_a_nutating_head_is_out_of_reach(tmp_path):
    machine = read_machine(write_machine(tmp_path, CHAINS["nutating"]))
    found, _ = inverse_rotary(machine, np.array([[0.0, 0.0, -1.0], [0.0, 1.0, -0.1]]) / [[1.0], [np.hypot(1, 0.1)]])
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


def test_links_are_carried_by_their_axes(machine):
    """What the tool is in goes where the tool goes, what the part is on stands, and a point that is fixed to the bed
    is in the machine's frame where it is seen from every link beside the part."""
    known = of(machine, joints(3, 200))
    tips, axes = forward(machine, known, 70.0)
    spindle = ["XYZ", *(axis.letter for axis in machine.tool_axes)][-1]
    turned, nose = link_poses(machine, spindle, known, 70.0)
    assert np.abs(nose - tips - 70.0 * axes).max() < 1e-10
    assert np.abs(turned[:, :, 2] - axes).max() < 1e-12
    assert np.abs(np.linalg.det(turned) - 1).max() < 1e-12

    inner = machine.part_axes[0].letter if machine.part_axes else "bed"
    stands, zero = link_poses(machine, inner, known)
    assert np.abs(stands - np.array(machine.part_frame)).max() < 1e-12
    assert np.abs(zero + machine.in_part(np.array([machine.part_zero]))).max() < 1e-12

    bed, origin = link_poses(machine, "bed", known)
    carried, at = link_poses(machine, "XYZ", known, 70.0)
    seen = np.einsum("nij,nj->ni", bed, known[:, :3] + [0.0, 0.0, 70.0]) + origin
    assert np.abs(seen - at).max() < 1e-10
    assert np.abs(carried - bed).max() < 1e-12


MODULES = Path("/usr/lib/linuxcnc/modules")


@pytest.fixture(scope="module")
def oracles(shared, tmp_path_factory):
    if not MODULES.is_dir():
        pytest.skip("LinuxCNC's kinematics modules (package linuxcnc-uspace) are absent")
    if not shutil.which("gcc"):
        pytest.skip("gcc is absent: the stand-in for LinuxCNC's HAL cannot be compiled")
    if not (shared / "nc" / "halstub.c").is_file():
        pytest.skip("the HAL stand-in (../shared/nc) is absent")
    library = tmp_path_factory.mktemp("hal") / "libhalstub.so"
    subprocess.run(["gcc", "-w", "-shared", "-fPIC", "-o", library, shared / "nc" / "halstub.c"], check=True)
    specification = importlib.util.spec_from_file_location("kins_oracle", shared / "nc" / "kins_oracle.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return lambda name, letters: module.Oracle(name, letters, f"{MODULES}/", str(library))


def compare(machine, oracle, slots, tool, rng):
    """Forward and inverse of 500 random joints; LinuxCNC's positions are those of the spindle nose."""
    angles = np.column_stack([rng.uniform(-100, 50, 500), rng.uniform(-400, 400, 500)])
    joints = np.column_stack([rng.uniform(-200, 200, (500, 3)), np.radians(angles)])
    tips, _ = forward(machine, joints, tool)
    nose = np.array([0, 0, tool])
    for row, (joint, tip) in enumerate(zip(joints, tips, strict=True)):
        place = oracle.fwd([*(joint[:3] + nose), *angles[row]])
        assert np.abs(place[:3] - nose - tip).max() < 1e-10
        pose = np.zeros(9)
        pose[:3], pose[slots] = tip + nose, angles[row]
        back = oracle.inv(pose)
        mine = inverse_linear(machine, tip[None], joint[None, 3:], tool)[0]
        assert np.abs(back[:3] - nose - mine[:3]).max() < 1e-10


def test_the_shipped_xyzbc_machine_is_linuxcncs_own(oracles):
    oracle = oracles("xyzbc-trt-kins", b"XYZBC")
    oracle.set(x_offset=-20, z_offset=-15, tool_offset=62.5, x_rot_point=0, y_rot_point=0, z_rot_point=0)
    compare(read_machine("linuxcnc-xyzbc"), oracle, [4, 5], 62.5, np.random.default_rng(1))


def test_the_shipped_xyzac_machine_is_linuxcncs_own(oracles):
    oracle = oracles("xyzac-trt-kins", b"XYZAC")
    oracle.set(y_offset=20, z_offset=10, tool_offset=62.5, x_rot_point=0, y_rot_point=0, z_rot_point=0)
    compare(read_machine("linuxcnc-xyzac"), oracle, [3, 5], 62.5, np.random.default_rng(3))


def test_a_machine_file_reproduces_xyzac_with_every_offset(oracles, tmp_path):
    oracle = oracles("xyzac-trt-kins", b"XYZAC")
    oracle.set(y_offset=20, z_offset=10, tool_offset=50, x_rot_point=1, y_rot_point=2, z_rot_point=3)
    rotary = {
        "C": {"direction": [0, 0, 1], "pivot": [1, 2, 3], "sign": 1, "endless": True},
        "A": {"direction": [1, 0, 0], "pivot": [1, 22, 13], "sign": 1, "limits_deg": [-180, 180]},
    }
    text = machine_text(["C", "A", "XYZ"], rotary).replace("part_zero = [1.0, -2.0, 3.0]", "")
    compare(read_machine(write_machine(tmp_path, text)), oracle, [3, 5], 50.0, np.random.default_rng(2))
