"""The machine that moves in the page's view of the program, against its kinematics."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy import ndarray
from scipy.spatial.transform import Rotation

import bonecam
from bonecam.machine.kinematics import forward, inverse_linear
from bonecam.machine.machine import Machine, read_machine
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect
from bonecam.report.page.contents import machine_facts, rotary_angles

pytestmark = pytest.mark.whole

Run = tuple[bonecam.Result, Path]
READY = """new Promise((done) => { const ask = () => (page.ready ? done() : setTimeout(ask, 50)); ask(); })"""
MARK = [7.0, -3.0, 20.0]
"""A point of the part, mm."""
STAND = """(steps) => steps.map((step) => {
    page.state.step = step;
    setTool(page.tool.body, step);
    moveWorld();
    page.scene.updateMatrixWorld(true);
    const tip = page.tool.body.getWorldPosition(new THREE.Vector3());
    const end = page.tool.body.localToWorld(new THREE.Vector3(0, 0, 1));
    const mark = page.world.localToWorld(new THREE.Vector3(7, -3, 20));
    return [tip.toArray(), end.sub(tip).toArray(), mark.toArray()];
})"""
"""Where the tip of the tool, its axis and the MARK stand at moves."""
KINDS = {
    "a trunnion": "table-table",
    "head and table": "head-table",
    "a head": "head-head",
    "a nutating table": "nutating",
    "a nutating head": "dmu-45",
    "four axes along X": "mill-4axis",
    "a spindle that lies": "lying",
}


@pytest.fixture(scope="module")
def page(small_run: Run, browser: Any) -> Iterator[Any]:
    """The page of the small run in its view of the program, the machine moving."""
    opened = browser.new_page(viewport={"width": 1100, "height": 700})
    opened.goto((small_run[1] / "bone.html").as_uri())
    opened.evaluate(READY)
    opened.keyboard.press("4")
    opened.locator("#machine").check()
    yield opened
    opened.close()


@pytest.fixture(params=KINDS.values(), ids=KINDS)
def machine(chains: dict[str, str], write_machine: Callable[..., Path], request: Any, tmp_path: Path) -> Machine:
    # Z along a spindle that lies: the table's normal is the machine's Y
    lying = chains["table-table"].replace("part_zero", "part_x = [1.0, 0.0, 0.0]\npart_z = [0.0, 1.0, 0.0]\npart_zero")
    text = {**chains, "lying": lying}.get(request.param)
    return read_machine(request.param if text is None else write_machine(tmp_path, text))


def turned(points: ndarray, machine_axes: Any, machine: Machine, rotary: ndarray) -> ndarray:
    """A point turned about axes one behind the other, at each row of angles (rad)."""
    for axis in machine_axes:
        pivot = np.array(axis.pivot)
        turns = Rotation.from_rotvec(rotary[:, [machine.column(axis) - 3]] * np.array(axis.direction))
        points = pivot + turns.apply(points - pivot)
    return points


def test_any_chain_stands_as_its_kinematics(page: Any, machine: Machine) -> None:
    count = 6
    rng = np.random.default_rng(1)
    joints = np.c_[rng.uniform(-90, 90, (count, 3)), rng.uniform(-3, 3, (count, 2))]
    for axis in machine.rotary:
        if axis.locked:
            joints[:, machine.column(axis)] = axis.limits[0]
    of_tool = "page.facts.tools.find((tool) => tool.number === page.arrays.move_tool[0])"
    length = float(page.evaluate(f"{of_tool}.length"))
    tips, axes = forward(machine, joints, length)
    arrays = {"move_tip": tips, "move_axis": axes, **rotary_angles(machine, joints)}
    page.evaluate(
        """([facts, arrays]) => {
            page.kept = [page.facts, page.arrays];
            page.facts = { ...page.facts, program: { ...page.facts.program, ...facts } };
            const flat = Object.entries(arrays).map(([name, rows]) => [name, Float32Array.from(rows.flat())]);
            page.arrays = { ...page.arrays, ...Object.fromEntries(flat) };
        }""",
        [machine_facts(machine), {name: values.tolist() for name, values in arrays.items()}],
    )
    found = np.array(page.evaluate(STAND, list(range(count))))
    page.evaluate("[page.facts, page.arrays] = page.kept")

    rotary = joints[:, 3:]
    zero = np.array(machine.part_zero)
    height = np.c_[np.zeros((count, 2)), joints[:, 2] - zero[2]]
    head = machine.tool_axes[::-1]
    swung, above = (turned(np.tile([0.0, 0.0, z], (count, 1)), head, machine, rotary) for z in (-length, 1 - length))
    part = np.tile(machine.in_machine(np.array([MARK]))[0] + zero, (count, 1))
    mark = turned(part, machine.part_axes, machine, rotary)
    assert np.allclose(found[:, 0], height + swung + [0, 0, length], atol=1e-3)
    assert np.allclose(found[:, 1], above - swung, atol=1e-5)
    assert np.allclose(found[:, 2], mark - np.c_[joints[:, :2], np.tile(zero[2], count)], atol=1e-3)


def test_the_program_moves_the_table_under_a_head_that_goes_up_and_down(page: Any, small_run: Run) -> None:
    result = small_run[0]
    machine = read_machine(result.job.nc.machine)
    motions = read_program(result.program.text, machine, job_dialect(result.job.nc))
    assert len(machine.part_axes) == 2
    steps = [100, 400, 700]
    assert abs(motions.axes[700, 2]) < 0.99
    found = np.array(page.evaluate(STAND, steps))
    joints = inverse_linear(machine, motions.tips[steps], motions.words[steps, 3:])
    zero = np.array(machine.part_zero)
    assert np.allclose(found[:, 0], np.c_[np.zeros((3, 2)), joints[:, 2] - zero[2]], atol=0.1)
    assert np.allclose(found[:, 1], [0, 0, 1], atol=2e-3)
    moved = page.evaluate("page.world.matrix.toArray()")
    page.locator("#machine").uncheck()
    assert page.evaluate("page.world.matrix.toArray()") == np.eye(4).ravel().tolist() != moved
    page.locator("#machine").check()


def test_it_is_told_what_moves_and_stands_in_other_views(page: Any, small_run: Run) -> None:
    axes = ", ".join(axis.letter for axis in read_machine(small_run[0].job.nc.machine).part_axes)
    assert f"the machine moves: table X, Y, {axes}, head Z" in page.locator("#controls").inner_text()
    page.keyboard.press("3")
    assert page.evaluate("page.world.matrix.toArray()") == np.eye(4).ravel().tolist()
    page.keyboard.press("4")
