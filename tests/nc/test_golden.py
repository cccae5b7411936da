"""The posted text of tiny paths, kept as files in tests/golden/<case>/."""

from pathlib import Path

import pytest
from small_parts import capsule_path

from bonecam.job import read_job
from bonecam.machine import read_machine
from bonecam.nc import read_dialect, read_program, write_program
from bonecam.nc.requirements import job_dialect
from bonecam.verify import Tolerances
from bonecam.verify.readback import compare_moves

GOLDEN = Path(__file__).parents[1] / "golden"
CASES = ("heidenhain-mikron", "linuxcnc-xyzbc", "siemens-mikron", "fanuc-mikron", "makino-mikron", "mitsubishi-mikron")


PATHS = (
    capsule_path(level=5, radius=2.0, offset=1.5, number=1, count=24, turns=0.5),
    capsule_path(level=0, radius=1.0, number=2, count=24, turns=0.5),
)


@pytest.fixture(scope="module", params=CASES)
def case(request):
    return str(request.param)


@pytest.fixture(scope="module")
def program(case):
    job = read_job(GOLDEN / case / "job.toml")
    return write_program(PATHS, read_machine(job.nc.machine), job_dialect(job.nc), job, name="GOLDEN")


def test_the_golden_program_is_still_posted(case, program):
    assert program.text == (GOLDEN / case / f"expected{program.extension}").read_text()


def test_the_golden_program_makes_the_golden_path(case, program):
    machine, dialect = read_machine(program.machine), read_dialect(program.controller)
    text = (GOLDEN / case / f"expected{program.extension}").read_text()
    checked = compare_moves(read_program(text, machine, dialect), PATHS, dialect, Tolerances())
    assert checked.tip_error.max() < 0.001
