"""The end of a program, and its optional stops: table level, park position, M1; written, read back, refused early."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from bonecam.errors import JobError, MachineError, ProgramError, VerifyError
from bonecam.job import Job
from bonecam.machine.machine import Machine, read_machine
from bonecam.nc.dialect import dialect_names
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect
from bonecam.tool.path import ToolPath
from bonecam.verify.control import check_limits, check_spindle

PARK = {
    "heidenhain": "L X+20.000 Y-30.500 R0 FMAX M91",
    "siemens-840d": "G0 SUPA X20.000 Y-30.500 D0",
    "fanuc-30i": "G53 G00 X20.000 Y-30.500",
    "makino": "G53 G00 X20.000 Y-30.500",
    "mitsubishi": "G53 G00 X20.000 Y-30.500",
    "linuxcnc": "G53 G0 X20.00000 Y-30.50000",
}


@pytest.fixture(scope="module")
def machine() -> Machine:
    """One whose place of the part is known: its linear axes have limits."""
    mikron = read_machine("mikron-ucp600")
    x, y, z = mikron.linear
    return replace(mikron, linear=(*(replace(axis, limits=(-400.0, 400.0)) for axis in (x, y)), z))


def text_of(paths: list[ToolPath], machine: Machine, controller: str, **nc: object) -> str:
    job = Job().with_values(nc={"controller": controller, **nc})
    return write_program(paths, machine, job_dialect(job.nc), job).text


@pytest.mark.parametrize("controller", dialect_names())
def test_the_program_ends_with_the_table_level_and_the_spindle_parked(
    controller: str, three_paths: list[ToolPath], machine: Machine
) -> None:
    text = text_of(three_paths, machine, controller, table_level=True, park="20, -30.5")
    assert text.count(PARK[controller]) == 1
    motions = read_program(text, machine, job_dialect(Job().with_values(nc={"controller": controller}).nc))
    last = motions.partial[-1]
    assert last.joints[:2] == (20.0, -30.5)
    assert np.isnan(last.joints[2])
    assert [math.remainder(angle, 360.0) for angle in last.joints[3:]] == [0.0, 0.0]
    before = text.split("\n")[last.line - 2]
    assert re.search(r"B\+?0\.0+ C(=DC\()?\+?0\.0+", before)
    check_limits(motions, machine)


@pytest.mark.parametrize("controller", dialect_names())
def test_a_text_that_parks_outside_the_limits_or_beside_the_part_is_refused(
    controller: str, three_paths: list[ToolPath], machine: Machine
) -> None:
    dialect = job_dialect(Job().with_values(nc={"controller": controller}).nc)
    text = text_of(three_paths[:1], machine, controller, park="20, -30.5")
    beyond = text.replace(PARK[controller], PARK[controller].replace("X20.", "X420.").replace("X+20.", "X+420."))
    with pytest.raises(VerifyError, match=r"^line \d+: X goes to 420.000 mm, its limit is 400 mm"):
        check_limits(read_program(beyond, machine, dialect), machine)
    low = PARK[controller].replace("X", "Z", 1).replace("Y", "Z", 1)
    with pytest.raises(ProgramError, match=r"^line \d+: "):
        read_program(text.replace(PARK[controller], low), machine, dialect)


@pytest.mark.parametrize("controller", ["fanuc-30i", "makino", "mitsubishi", "linuxcnc"])
def test_the_program_ends_at_the_reference_point_of_x_and_y(controller: str, three_paths: list[ToolPath]) -> None:
    machine = read_machine("mikron-ucp600")
    text = text_of(three_paths[:1], machine, controller, park="home")
    assert len(re.findall(r"(?m)^(N\d+ )?G28 G91 X0\.? Y0\.?$", text)) == 1
    dialect = job_dialect(Job().with_values(nc={"controller": controller}).nc)
    motions = read_program(text, machine, dialect)
    assert np.isnan(motions.partial[-1].joints[:3]).all()
    assert not motions.partial[-1].retract
    low = re.sub(r"(?m)^((?:N\d+ )?G28 G91 X0\.?) Y0", r"\1 Y5", text)
    with pytest.raises(ProgramError, match=r"^line \d+: in machine coordinates"):
        read_program(low, machine, dialect)


@pytest.mark.parametrize("controller", ["heidenhain", "siemens-840d"])
def test_where_a_control_has_no_words_for_home_that_is_one_line(controller: str) -> None:
    told = rf"^nc.park = 'home': {controller} has no such: leave it out, or add a template home to its file$"
    with pytest.raises(MachineError, match=told):
        job_dialect(Job().with_values(nc={"controller": controller, "park": "home"}).nc)


def test_a_park_position_without_a_retract_before_it_is_refused(three_paths: list[ToolPath], machine: Machine) -> None:
    job = Job().with_values(nc={"controller": "linuxcnc", "park": "0, 0"})
    text = write_program(three_paths[:1], machine, job_dialect(job.nc), job).text
    lines = text.split("\n")
    park = next(at for at, line in enumerate(lines) if line.startswith("G53"))
    retract = next(at for at in reversed(range(park)) if lines[at].startswith("G0 Z"))
    wrong = "\n".join([*lines[:retract], *lines[retract + 1 :]])
    with pytest.raises(ProgramError, match="before a retract"):
        read_program(wrong, machine, job_dialect(job.nc))


@pytest.mark.parametrize(
    ("park", "told"),
    [("500, 0", r"X of mikron-ucp600 runs from -400 to 400 mm"), ("0, -401", r"Y of mikron-ucp600 runs from")],
)
def test_a_park_position_outside_the_limits_is_one_line(
    park: str, told: str, three_paths: list[ToolPath], machine: Machine
) -> None:
    with pytest.raises(JobError, match=rf"^\[nc\] park = '{park}': {told}"):
        text_of(three_paths[:1], machine, "heidenhain", park=park)


def test_where_only_travels_are_known_no_park_position_is_taken(three_paths: list[ToolPath]) -> None:
    with pytest.raises(JobError, match="states the travel of X, not its limits"):
        text_of(three_paths[:1], read_machine("mikron-ucp600"), "heidenhain", park="0, 0")


@pytest.mark.parametrize("park", ["here", "1", "1, 2, 3", "nan, 0", "1e9, 0"])
def test_what_is_no_park_position_is_told(park: str) -> None:
    with pytest.raises(JobError, match="park = "):
        Job().with_values(nc={"park": park})


def test_an_axis_that_cannot_stand_at_zero_is_not_levelled(three_paths: list[ToolPath], machine: Machine) -> None:
    tilted = tuple(
        replace(axis, limits=(np.radians(-115.0), np.radians(-1.0))) if axis.letter == "B" else axis
        for axis in machine.part_axes
    )
    with pytest.raises(MachineError, match=r"B of .* cannot stand at zero \(-115 to -1 deg\)"):
        text_of(three_paths[:1], replace(machine, part_axes=tilted), "heidenhain", table_level=True)


@pytest.mark.parametrize("controller", dialect_names())
@pytest.mark.parametrize(("where", "stops"), [("none", 0), ("level", 2), ("tool", 1)])
def test_optional_stops_stand_where_the_job_says_and_the_spindle_starts_again(
    controller: str, where: str, stops: int, three_paths: list[ToolPath]
) -> None:
    machine = read_machine("mikron-ucp600")
    text = text_of(three_paths, machine, controller, optional_stop=where)
    assert len(re.findall(r"(?m)^(?:N?\d+ )?M0?1$", text)) == stops
    dialect = job_dialect(Job().with_values(nc={"controller": controller}).nc)
    check_spindle(read_program(text, machine, dialect), machine, dialect)
    if controller == "heidenhain" and stops:
        first = text.index("M1\n")
        start = text.index("M3\n", first)
        unstarted = text[:start] + "M9\n" + text[start + 3 :]
        with pytest.raises(VerifyError, match="spindle"):
            check_spindle(read_program(unstarted, machine, dialect), machine, dialect)


@pytest.mark.parametrize("controller", ["fanuc-30i", "linuxcnc"])
def test_a_park_position_by_increments_is_refused(
    controller: str, three_paths: list[ToolPath], machine: Machine
) -> None:
    text = text_of(three_paths[:1], machine, controller, park="20, -30.5", block_numbers=False)
    dialect = job_dialect(Job().with_values(nc={"controller": controller, "block_numbers": False}).nc)
    read_program(text, machine, dialect)
    moved = re.sub(r"(?m)^(G53 G0+ X20)", r"G91 \1", text)
    assert moved != text
    with pytest.raises(ProgramError, match=r"^line \d+: machine coordinates by increments: switch to absolute"):
        read_program(moved, machine, dialect)
