"""The kinematics against LinuxCNC's own modules, loaded without realtime."""

import importlib.util
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from bonecam.machine.kinematics import forward, inverse_linear
from bonecam.machine.machine import read_machine

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


def test_a_machine_file_reproduces_xyzac_with_every_offset(machine_text, write_machine, oracles, tmp_path):
    oracle = oracles("xyzac-trt-kins", b"XYZAC")
    oracle.set(y_offset=20, z_offset=10, tool_offset=50, x_rot_point=1, y_rot_point=2, z_rot_point=3)
    rotary = {
        "C": {"direction": [0, 0, 1], "pivot": [1, 2, 3], "sign": 1, "endless": True},
        "A": {"direction": [1, 0, 0], "pivot": [1, 22, 13], "sign": 1, "limits_deg": [-180, 180]},
    }
    text = machine_text(["C", "A", "XYZ"], rotary).replace("part_zero = [1.0, -2.0, 3.0]", "")
    compare(read_machine(write_machine(tmp_path, text)), oracle, [3, 5], 50.0, np.random.default_rng(2))
