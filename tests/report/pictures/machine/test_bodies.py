"""The picture of the machine's bodies: the pose that it shows is the lowest one, told with its height."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bonecam.job import HoldingJob, Job
from bonecam.machine.bodies import Frustum, Table
from bonecam.machine.machine import read_machine
from bonecam.report import draw_machine, machine_picture
from bonecam.setup.capsule import Capsule
from bonecam.tool import Cutter, ToolPath

TOOL = Cutter.from_job(2, "finishing", Job().tool("finishing"), [Frustum(35.0, 80.0, 60.0)])


@pytest.fixture
def path(path_of: Callable[..., ToolPath]) -> ToolPath:
    """Cuts whose axes lean ever more, the first row being a rapid that leans most."""
    polar = np.radians([110.0, 10, 50, 90, 100, 30])
    axes = np.column_stack([np.sin(polar), 0 * polar, np.cos(polar)])
    return path_of(np.tile([3.0, 0, 120], (6, 1)), axes, tool=TOOL)


def test_the_height_told_is_that_of_the_body_drawn(path: ToolPath) -> None:
    heights = machine_picture._lowest(path)
    assert np.isinf(heights[0])
    assert heights.argmin() == 4
    for row in range(1, 6):
        bodies = machine_picture._tool(path.cutter, path.tips[row], path.axes[row])
        drawn = min(mesh.vertices[:, 2].min() for name, mesh in bodies if name in ("holder", "spindle"))
        assert heights[row] == pytest.approx(drawn, abs=0.3)


def test_the_picture_is_written_from_both_sides_with_what_there_is(path: ToolPath, tmp_path: Path) -> None:
    part = Capsule(np.array([0.0, 0, 108]), np.array([0.0, 0, 120]), 3.0).mesh(0.1)
    holding = HoldingJob(diameter=4.0, length=105.0)
    table = Table(radius=100.0, standing=(Frustum(20.0, 40.0, 30.0),))
    machine = replace(read_machine("mikron-ucp600"), table=table)
    draw_machine([path, path], part, holding, machine, tmp_path / "machine.png")
    assert (tmp_path / "machine.png").read_bytes().startswith(b"\x89PNG")


def test_a_table_is_drawn_as_wide_as_it_is() -> None:
    drawn = machine_picture.table_bodies(Table(radius=140.0))[0][1]
    assert drawn.bounds[1, 0] == pytest.approx(140.0)
