"""All that a page shows of a run."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bonecam.job import Job
from bonecam.levels.measure.level import Level
from bonecam.mesh.part import Part
from bonecam.nc.dialect import read_dialect
from bonecam.nc.machine import read_machine
from bonecam.setup.stock import Stock
from bonecam.toolpath.path import ToolPath
from bonecam.verify.page.packing import Contents
from bonecam.verify.page.program_contents import program_contents
from bonecam.verify.page.shape_contents import shape_contents
from bonecam.verify.removal.of_job import cutters_of
from bonecam.verify.removal.result import Removal
from bonecam.verify.summary import summary_of


def run_contents(
    part: Part,
    levels: Sequence[Level],
    stock: Stock,
    job: Job,
    report: dict[str, Any],
    version: str,
    *,
    program: str = "",
    paths: Sequence[ToolPath] = (),
    removal: Removal | None = None,
) -> Contents:
    """Levels and fit, and where there is a `program` its moves, what it removes and what it leaves."""
    machine = read_machine(job.nc.machine)
    shape = shape_contents(part, levels, stock, job, machine.table, Path(part.file).name)
    facts = {**shape.facts, "report": report, "summary": summary_of(report), "version": version}
    if not program:
        return Contents(facts, shape.arrays)
    posted = program_contents(
        program,
        {level.index: level.mesh for level in levels},
        cutters_of(job, machine),
        machine,
        read_dialect(job.nc.controller),
        paths=paths,
        removal=removal,
    )
    posted.facts["program"]["minutes"] = report["nc"]["time_min"]
    return Contents({**facts, **posted.facts}, {**shape.arrays, **posted.arrays})
