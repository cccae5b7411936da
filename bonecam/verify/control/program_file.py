"""The text of a program in a file, judged for the machine, the control and the job that it is to run for."""

from pathlib import Path

from bonecam.errors import ProgramError, VerifyError
from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.parts.joined import joined
from bonecam.nc.reading.read import read_program
from bonecam.nc.words import comment, comments_of
from bonecam.text.faults import shown
from bonecam.verify.control.check import check_control

HEADER_LINES = 20
"""Lines of a program in which its header names the machine and the stock."""


def program_text(program: Path, machine: Machine, dialect: Dialect, job: Job) -> str:
    """The text of a program for this machine and job, and of the files it calls. ProgramError where it is for another
    machine or cannot be read, VerifyError where its control would refuse it, or run it otherwise than the job
    means."""
    whole = joined(program, dialect)
    text = whole.text
    _require_machine(text, machine, dialect, program)
    try:
        check_control(read_program(text, machine, dialect), machine, dialect, job)
    except (ProgramError, VerifyError) as error:
        place = str(program)
        line = error.evidence.get("line", 0)
        if line and {file for file, _ in whole.places} != {program}:
            place = f"{whole.place(line)} (of the whole program"
            raise type(error)(f"{place} {error})", **error.evidence) from error
        raise type(error)(f"{program}: {error}", **error.evidence) from error
    return text


def header_of(text: str) -> str:
    """The lines of a program in which its header tells what is mounted."""
    return "\n".join(text.split("\n")[:HEADER_LINES])


def _require_machine(text: str, machine: Machine, dialect: Dialect, program: Path) -> None:
    """ProgramError where the text is for another kind of control, or the header names another machine."""
    first = text.split("\n", 1)[0]
    begins = "BEGIN PGM" if "BEGIN PGM" in first else "%" if first.strip() == "%" else ""
    if begins and begins != ("BEGIN PGM" if dialect.grammar == "klartext" else dialect.frame):
        raise ProgramError(
            f"{program}: its first line ({shown(first)}) is of another control than {dialect.title}: give its "
            "--controller",
            line=1,
        )
    wanted = comments_of(f"machine {machine.title}", dialect)[0]
    start = comment("machine", dialect).rstrip(")")
    named = [line for line in header_of(text).split("\n") if start in line]
    if named and not any(wanted in line for line in named):
        reported = named[0].strip()
        raise ProgramError(
            f"{program}: it was made for another machine ({reported}), not for {machine.title}: give its --machine",
            line=0,
        )
