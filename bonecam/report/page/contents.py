"""All that a page shows of a run."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bonecam.job import Job
from bonecam.levels.measure.level import Level
from bonecam.machine.machine import read_machine
from bonecam.mesh.part import Part
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.job_dialect import job_dialect
from bonecam.report.page.packing import Contents
from bonecam.report.page.program_contents import program_contents
from bonecam.report.page.shape_contents import shape_contents
from bonecam.report.summary import summary_of
from bonecam.setup.stock import Stock
from bonecam.tool.path import ToolPath
from bonecam.verify.removal.result import Removal

PROGRAM_FACTS = ("tools", "program", "uncut", "left")
PROGRAM_ARRAYS = ("move_", "before_", "after_", "cut_at_", "uncut", "left", "text")
"""Names of facts, and beginnings of names of arrays, that belong to a program."""


def run_contents(
    part: Part,
    levels: Sequence[Level],
    stock: Stock,
    job: Job,
    report: Mapping[str, Any],
    version: str,
    *,
    program: str = "",
    paths: Sequence[ToolPath] = (),
    removal: Removal | None = None,
) -> Contents:
    """Levels and fit, and where there is a `program` its moves, what it removes and what it leaves."""
    machine = read_machine(job.nc.machine)
    shape = shape_contents(part, levels, stock=stock, job=job, table=machine.table, name=Path(part.file).name)
    facts = {**shape.facts, "report": report, "summary": summary_of(report), "version": version}
    if not program:
        return Contents(facts, shape.arrays)
    posted = program_contents(
        program,
        {level.index: level.mesh for level in levels},
        job,
        machine,
        job_dialect(job.nc),
        paths=paths,
        removal=removal,
    )
    posted.facts["program"]["time"] = report["nc"]["time_texts"][0]
    return Contents({**facts, **posted.facts}, {**shape.arrays, **posted.arrays})


def level_meshes(contents: Contents) -> dict[int, TriangleMesh]:
    """The meshes of the levels that a page shows, by number."""
    arrays = contents.arrays
    return {
        level["index"]: TriangleMesh(arrays[f"level_{level['index']}"], arrays[level["faces"]].astype(np.int32))
        for level in contents.facts["levels"]
    }


def with_program(run: Contents, posted: Contents, report: dict[str, Any], summary: str) -> Contents:
    """A page of the levels of a `run` with another program; `report` has the sections that are told of it."""
    facts = {name: fact for name, fact in run.facts.items() if name not in PROGRAM_FACTS}
    arrays = {name: array for name, array in run.arrays.items() if not name.startswith(PROGRAM_ARRAYS)}
    sections = {name: section for name, section in facts["report"].items() if name not in ("nc", "toolpath")}
    reported = {"report": {**sections, **report}, "summary": summary}
    return Contents({**facts, **reported, **posted.facts}, {**arrays, **posted.arrays})
