"""The room that a program takes: every move of it counts."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.errors import MachineError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program


@pytest.mark.parametrize("name", ["siemens-840d", "heidenhain", "fanuc-30i"])
def test_a_tool_that_starts_over_zero_beyond_a_limit_is_refused(name, chains, write_machine, path_of, tmp_path):
    """The path itself is at X 200 upright, X 0 is beyond the limit of 60."""
    tips = np.column_stack([np.linspace(200.0, 220.0, 9), np.zeros(9), np.full(9, 60.0)])
    path = path_of(tips, np.tile([0.0, 0.0, 1.0], (9, 1)))
    text = chains["head-head"].replace("[X]\ntravel = 4000.0", "[X]\nlimits = [60.0, 400.0]")
    machine = read_machine(write_machine(tmp_path, text))
    with pytest.raises(MachineError, match=r"the start of its tool: X 1\.0 mm leaves the limit 60\.0 mm") as caught:
        write_program([path], machine, read_dialect(name), Job())
    assert caught.value.evidence["axis"] == "X"

    wide = read_machine(write_machine(tmp_path, text.replace("[60.0, 400.0]", "[0.9, 400.0]"), "wide"))
    assert write_program([path], wide, read_dialect(name), Job()).moves


@pytest.mark.parametrize(("name", "axis"), [("mill-4axis", [0.0, -1.0, 0.0]), ("pocket-nc", [0.0, 0.0, 1.0])])
@pytest.mark.parametrize("dialect", ["heidenhain", "siemens-840d", "fanuc-30i", "linuxcnc"])
def test_the_spindle_starts_beside_the_plane_of_a_table_that_stands_on_edge(
    name: str, axis: list[float], dialect: str, path_of
) -> None:
    """Over the program's zero a nose of 150 mm would stand across the table: the path is 50 mm from that."""
    tips = np.column_stack([np.zeros(9), np.zeros(9), np.linspace(50.0, 54.0, 9)])
    machine, controller = read_machine(name), read_dialect(dialect)
    long = [replace(one, travel=500.0) for one in machine.linear]
    machine = replace(machine, linear=tuple(long), tool_centre_control="M128")
    text = write_program([path_of(tips, np.tile(axis, (9, 1)))], machine, controller, Job()).text
    motions = read_program(text, machine, controller)
    assert motions.tips[:, 2].min() > 49.0
