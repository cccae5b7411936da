"""The words of a job in the dialect of its controller: work offset, coolant, block numbers, decimals."""

from collections.abc import Callable

import pytest

from bonecam.errors import MachineError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import dialect_names, read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect
from bonecam.tool.path import ToolPath


def job(controller: str, **nc: object) -> Job:
    return Job().with_values(nc={"controller": controller, **nc})


@pytest.mark.parametrize("controller", dialect_names())
def test_a_job_that_asks_for_nothing_has_the_dialect_of_its_controller(controller: str) -> None:
    assert job_dialect(job(controller).nc) == read_dialect(controller)


@pytest.mark.parametrize("controller", dialect_names())
def test_another_work_offset_is_written_and_asked_for_again_when_read(
    controller: str, capsule_path: Callable[..., ToolPath]
) -> None:
    asked = job(controller, work_offset=3)
    machine, dialect = read_machine("mikron-ucp600"), job_dialect(asked.nc)
    path = capsule_path(count=60)
    text = write_program([path], machine, dialect, asked).text
    first, third = ("Q339=1", "Q339=3") if controller == "heidenhain" else ("G54", "G56")
    assert third in text
    assert first not in text
    assert len(read_program(text, machine, dialect).tips) > 10
    with pytest.raises(Exception, match=r"line \d+"):
        read_program(text, machine, read_dialect(controller))


@pytest.mark.parametrize("controller", dialect_names())
def test_mist_is_switched_on_in_the_place_of_flood(controller: str, capsule_path: Callable[..., ToolPath]) -> None:
    asked = job(controller, coolant_kind="mist")
    machine, dialect = read_machine("mikron-ucp600"), job_dialect(asked.nc)
    text = write_program([capsule_path(count=60)], machine, dialect, asked).text
    assert "M7" in text or "M07" in text
    assert read_program(text, machine, dialect).coolant.any()


def test_blocks_without_numbers_and_with_other_decimals_are_read_back(capsule_path: Callable[..., ToolPath]) -> None:
    asked = job("fanuc-30i", block_numbers=False, decimals=4, program_number=4711)
    machine, dialect = read_machine("mikron-ucp600"), job_dialect(asked.nc)
    text = write_program([capsule_path(count=60)], machine, dialect, asked).text
    assert "\nO4711" in text
    assert not [line for line in text.split("\n") if line.startswith("N")]
    assert any(len(word.partition(".")[2]) == 4 for line in text.split("\n") for word in line.split())
    assert len(read_program(text, machine, dialect).tips) > 10


@pytest.mark.parametrize(
    ("controller", "asked", "why"),
    [
        ("siemens-840d", {"work_offset": 9}, "nc.work_offset = 9: siemens-840d has no such: give 1 to 4"),
        ("fanuc-30i", {"coolant_kind": "air"}, "nc.coolant_kind = 'air': fanuc-30i has no such: add it"),
        ("heidenhain", {"block_numbers": False}, "nc.block_numbers = false: heidenhain has no such"),
    ],
)
def test_what_a_control_does_not_have_is_refused(controller: str, asked: dict[str, object], why: str) -> None:
    with pytest.raises(MachineError, match=why):
        job_dialect(job(controller, **asked).nc)
