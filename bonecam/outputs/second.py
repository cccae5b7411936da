"""The program of the second clamping, as a result keeps it, and what the report tells of it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bonecam.job import Job
from bonecam.nc.program import Program
from bonecam.setup.fixture.shell import SecondClamping
from bonecam.toolpath.path import ToolPath
from bonecam.verify.removal.result import Removal


@dataclass(frozen=True, eq=False, repr=False)
class SecondProgram:
    """Part and shell after the turn-over, the tool path of each layer in machining order, the program and what it
    removes. `report` is `second` of the run's report."""

    clamping: SecondClamping
    paths: tuple[ToolPath, ...]
    program: Program
    removal: Removal
    report: dict[str, Any]

    def __repr__(self) -> str:
        return f"<second clamping: {self.program!r}>"


def second_file(program: str | Path | None, job: Job) -> Path | None:
    """The file of the second program beside that of the first, bone.second.h beside bone.h; None where none is
    wanted."""
    if program is None or not job.holding.second:
        return None
    path = Path(program)
    return path.with_name(f"{path.stem}.second{path.suffix}")
