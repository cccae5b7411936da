"""All that a page shows of a second clamping."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.job_dialect import job_dialect
from bonecam.report.page.packing import Contents
from bonecam.report.page.program_contents import program_contents
from bonecam.report.page.shape_contents import bodies
from bonecam.report.summary import second_text
from bonecam.tool.path import ToolPath
from bonecam.verify.removal.result import Removal
from bonecam.workholding.shell import SecondClamping


def second_contents(
    clamping: SecondClamping,
    program: str,
    paths: Sequence[ToolPath],
    removal: Removal,
    job: Job,
    report: Mapping[str, Any],
    name: str,
    version: str,
) -> Contents:
    """The finished part turned over, its shell, and the moves of the program; the job's [holding] is the shell's."""
    machine = read_machine(job.nc.machine)
    posted = program_contents(
        program,
        {0: clamping.part},
        job,
        machine,
        job_dialect(job.nc),
        paths=paths,
        removal=removal,
        surfaces=layers_on(clamping.part, removal),
    )
    posted.facts["program"]["time"] = report["time_texts"][0]
    reported = {
        "name": f"{name}, second clamping",
        **bodies(job, machine.table),
        "report": report,
        "summary": second_text(report),
        "version": version,
    }
    shapes = _shapes(clamping)
    return Contents({**shapes.facts, **reported, **posted.facts}, {**shapes.arrays, **posted.arrays})


def _shapes(clamping: SecondClamping) -> Contents:
    """Part and shell. `turned` of the facts tells the height of the first program's zero, and where the post was cut
    off there, mm."""
    low, high = clamping.solids.bounds
    facts = {
        "levels": [{"index": 0, "name": "the finished part", "faces": "faces_0", "limit": 0.0}],
        "stock": {"text": f"turned over in its shell, stump up to Z {clamping.top:.2f} mm"},
        "stock_bounds": [low.tolist(), np.maximum(high, [-np.inf, -np.inf, clamping.top]).tolist()],
        "post": None,
        "solid": "shell",
        "turned": {"zero_mm": float(clamping.pose[2, 3]), "cut_off_mm": clamping.cut_off},
    }
    arrays = {
        "level_0": clamping.part.vertices,
        "faces_0": clamping.part.faces,
        "solid": clamping.shell.vertices,
        "solid_faces": clamping.shell.faces,
    }
    return Contents(facts, arrays)


def layers_on(part: TriangleMesh, removal: Removal) -> dict[int, TriangleMesh]:
    """The part for every layer of a program that was simulated: all of them lie on it."""
    return {level.index: part for level in removal.levels if level.index is not None}
