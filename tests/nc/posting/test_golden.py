"""The posted text of tiny paths, kept as files in tests/golden/<case>/."""

from pathlib import Path

import pytest
from synthetic_paths import capsule_path

from bonecam.job import read_job
from bonecam.nc.dialect import read_dialect
from bonecam.nc.machine import read_machine
from bonecam.nc.posting.write import write_program
from bonecam.nc.program import Program
from bonecam.nc.reading.read import read_program
from bonecam.verify.readback import Tolerances, compare

GOLDEN = Path(__file__).parents[2] / "golden"
CASES = ("heidenhain-mikron", "linuxcnc-xyzbc")
PATHS = (
    capsule_path(level=5, radius=2.0, offset=1.5, number=1, count=24, turns=0.5),
    capsule_path(level=0, radius=1.0, number=2, count=24, turns=0.5),
)


def posted(case: str) -> Program:
    job = read_job(GOLDEN / case / "job.toml")
    return write_program(
        PATHS, read_machine(job.nc.machine), read_dialect(job.nc.controller), job, name="GOLDEN"
    )


@pytest.mark.parametrize("case", CASES)
def test_the_golden_program_is_still_posted(case):
    program = posted(case)
    assert program.text == (GOLDEN / case / f"expected{program.extension}").read_text()


@pytest.mark.parametrize("case", CASES)
def test_the_golden_program_makes_the_golden_path(case):
    program = posted(case)
    machine, dialect = read_machine(program.machine), read_dialect(program.controller)
    text = (GOLDEN / case / f"expected{program.extension}").read_text()
    checked = compare(read_program(text, machine, dialect), PATHS, dialect, Tolerances())
    assert checked.tip_error.max() < 0.001
